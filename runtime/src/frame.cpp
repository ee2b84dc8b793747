#include "figurine/frame.h"

namespace figurine {

const char* to_string(PixelFormat format) {
  switch (format) {
    case PixelFormat::kRgba8:
      return "rgba8";
    case PixelFormat::kRgbaF32:
      return "rgba_f32";
    case PixelFormat::kBgra8:
      return "bgra8";
    case PixelFormat::kRgb24:
      return "rgb24";
    case PixelFormat::kBgr24:
      return "bgr24";
    case PixelFormat::kYuyv:
      return "yuyv";
    case PixelFormat::kNv12:
      return "nv12";
  }
  return "unknown pixel format";
}

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
