// One number out of a Python pickle, without running it.
//
// A pickle is a program for a small stack machine that may call anything. This machine knows only
// what Python and NumPy themselves write for a number: int and float, NumPy's scalars, arrays of
// one element, in protocols 0 to 5. Everything else is refused by the name of what it asks for.
//
// Based on: Python's Lib/pickletools.py; NumPy's scalar.__reduce__ and ndarray.__reduce__.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace figurine::dataset {

// where: of messages. Throws InputError: it ends early, holds something else, the number is not
// finite.
double read_pickled_number(std::span<const std::byte> bytes, const std::string& where);

}  // namespace figurine::dataset
