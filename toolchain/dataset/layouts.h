// The two layouts of captures, and the steps that they share. Only dataset.cpp calls the readers.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "toolchain/dataset/dataset.h"
#include "toolchain/dataset/picture_reader.h"

namespace figurine::dataset {

DatasetParts read_mvhumannet(const std::string& directory, const DatasetOptions& options);
DatasetParts read_easymocap(const std::string& directory, const DatasetOptions& options);

using NumberedFiles = std::map<uint32_t, std::string>;  // paths

// The leading digits of a file name: 5 of "0005_img.jpg". Nothing if there are none or too many.
std::optional<uint32_t> leading_number(const std::string& name);

// Pictures of a folder by the leading number of their names; nothing if there is no folder. Throws
// InputError on two of one number.
NumberedFiles numbered_pictures(const std::string& folder);

// The first of these folders below `root` that is there. Throws InputError naming them all if none
// is.
std::string existing_folder(const std::filesystem::path& root,
                            const std::vector<std::string>& names, const char* what);

// Images and masks of one camera; images_left_out counts those without a mask, and those of frames
// that are missing here.
struct CameraFiles {
  NumberedFiles images, masks;
};

// Fills parts.images and parts.masks [V][F] for the frames and cameras that parts has.
void match_files(const std::vector<CameraFiles>& files, DatasetParts& parts);

// Frames and cameras held out by default_split.
void split_by_rule(DatasetParts& parts);

// Leaves out cameras that cannot show the person: in no frame is the root in front of it, within
// the image (widened by half of its size on each side) and so near that a person is kLeastPerson_px
// high. Throws InputError if none is left. `what` names where the cameras come from.
void leave_out_blind_cameras(const DatasetOptions& options, const std::string& what,
                             DatasetParts& parts);

// The capture's shape, as far as the body has directions for it; a remark where that cuts off what
// is not zero. Throws InputError as check_shape.
void take_shape(const std::vector<float>& shapes, const DatasetOptions& options,
                const std::string& where, DatasetParts& parts);

// k: [3,3] of a camera. Throws InputError "where: reason" unless it is fx 0 cx, 0 fy cy, 0 0 1:
// other forms (transposed, with skew) would be read wrongly.
void check_intrinsics(const std::vector<double>& k, const std::string& where);

// "3 images" for remarks.
std::string counted(uint64_t count, const char* what);

}  // namespace figurine::dataset
