#include "figurine/frame.h"

namespace figurine {

const char* to_string(Stage stage) {
  switch (stage) {
    case Stage::kMaps:
      return "maps";
    case Stage::kNetwork:
      return "network";
    case Stage::kDecode:
      return "decode";
    case Stage::kSkin:
      return "skin";
    case Stage::kProject:
      return "project";
    case Stage::kBin:
      return "bin";
    case Stage::kSort:
      return "sort";
    case Stage::kBlend:
      return "blend";
    case Stage::kResolve:
      return "resolve";
  }
  return "unknown stage";
}

}  // namespace figurine
