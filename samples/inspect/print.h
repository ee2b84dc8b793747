// The inspector's documents as text for people. What a program should read is --json.
#pragma once

#include <string>

#include "samples/inspect/describe.h"

namespace figurine::inspect {

std::string print_package(const Json& document);
std::string print_tensors(const Json& tensors);
// The quantisation of every layer's output, and of its weights where they are; empty for null.
std::string print_quantisation(const Json& fixed_point);
std::string print_comparison(const Json& comparison);

}  // namespace figurine::inspect
