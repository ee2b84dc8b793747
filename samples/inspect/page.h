// The inspector's document as a page: one file of HTML with its pictures in it.
#pragma once

#include <string>
#include <vector>

#include "samples/inspect/describe.h"
#include "samples/inspect/pictures.h"

namespace figurine::inspect {

// document: of describe(). Every figure of it is on the page, in words where there are some, and
// all of them by name at its end (the first kMostFields; a population has one for each member).
std::string page_html(const Json& document, const std::vector<PictureSection>& pictures);
inline constexpr size_t kMostFields = 4000;

// FOLDER/index.html: whole or not at all. A folder that is made for it goes if it cannot be.
Status write_page(const std::string& folder, const std::string& html);

}  // namespace figurine::inspect
