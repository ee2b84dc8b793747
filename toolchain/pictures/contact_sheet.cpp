#include "toolchain/pictures/contact_sheet.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "toolchain/error.h"
#include "toolchain/pictures/avatar_pictures.h"
#include "toolchain/train/facing.h"

namespace figurine::pictures {

using measure::bounding_box;
using measure::Box;
using measure::kMidGrey;
using measure::Picture;

namespace {

constexpr int kGap_px = 4;
// Of the box's side. A head and half of it on each side are head and shoulders.
constexpr float kPersonMargin = 0.03f, kBustMargin = 0.5f, kDetailMargin = 0.25f;

// The box grown to width = aspect * height around its centre, then by the margin.
Box framed(const Box& box, float aspect, float margin) {
  const float cx = 0.5f * float(box.x0 + box.x1), cy = 0.5f * float(box.y0 + box.y1);
  float width = float(box.x1 - box.x0) * (1 + 2 * margin),
        height = float(box.y1 - box.y0) * (1 + 2 * margin);
  if (width < aspect * height) {
    width = aspect * height;
  } else {
    height = width / aspect;
  }
  return {
      static_cast<int>(std::floor(cx - width / 2)), static_cast<int>(std::floor(cy - height / 2)),
      static_cast<int>(std::ceil(cx + width / 2)), static_cast<int>(std::ceil(cy + height / 2))};
}

float sample(const Picture& picture, int x, int y, int channel) {
  if (x < 0 || y < 0 || x >= int(picture.width_px) || y >= int(picture.height_px)) return kMidGrey;
  const uint8_t* p = &picture.rgba[(size_t(y) * picture.width_px + x) * 4];
  return (float(p[channel]) + float(255 - p[3]) * kMidGrey) / 255.0f;
}

// Scales `box` of the picture into the sheet's rectangle: bilinear, half-pixel centres.
// Down-scaling by more than two would alias; boxes are not that large.
void paste(const Picture& picture, const Box& box, ports::ImageU8& sheet, uint32_t x0, uint32_t y0,
           uint32_t width, uint32_t height) {
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const float sx =
          float(box.x0) + (float(x) + 0.5f) * float(box.x1 - box.x0) / float(width) - 0.5f;
      const float sy =
          float(box.y0) + (float(y) + 0.5f) * float(box.y1 - box.y0) / float(height) - 0.5f;
      const int ix = static_cast<int>(std::floor(sx)), iy = static_cast<int>(std::floor(sy));
      const float fx = sx - float(ix), fy = sy - float(iy);
      for (int c = 0; c < 3; ++c) {
        const float top =
            sample(picture, ix, iy, c) * (1 - fx) + sample(picture, ix + 1, iy, c) * fx;
        const float bottom =
            sample(picture, ix, iy + 1, c) * (1 - fx) + sample(picture, ix + 1, iy + 1, c) * fx;
        sheet.at(x0 + x, y0 + y)[c] = static_cast<uint8_t>(
            std::clamp(top * (1 - fy) + bottom * fy, 0.0f, 1.0f) * 255.0f + 0.5f);
      }
    }
  }
}

std::vector<std::pair<size_t, size_t>> choose_pictures(const train::TrainedAvatar& avatar,
                                                       size_t count) {
  const dataset::Dataset& data = avatar.data();
  std::vector<std::pair<size_t, size_t>> both, any;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
      if (data.cameras()[camera].framing != dataset::Framing::kBody) continue;
      const dataset::Role role = data.role(frame, camera);
      if (role == dataset::Role::kHeldOutViewAndPose) both.emplace_back(frame, camera);
      if (role != dataset::Role::kTrain && role != dataset::Role::kMissing)
        any.emplace_back(frame, camera);
    }
  }
  const auto& from = both.empty() ? any : both;
  if (from.empty())
    throw InputError(data.directory() + ": nothing is held out, so there is nothing to show");
  // Evenly over the frames; every other picture from the camera that sees most of the face, the
  // others one camera further each time.
  std::vector<size_t> starts;  // of each frame's stretch of the list
  for (size_t i = 0; i < from.size(); ++i) {
    if (i == 0 || from[i].first != from[i - 1].first) starts.push_back(i);
  }
  std::vector<std::pair<size_t, size_t>> chosen;
  for (size_t i = 0; i < count; ++i) {
    const size_t at = i * starts.size() / count,
                 end = at + 1 < starts.size() ? starts[at + 1] : from.size();
    size_t pick = starts[at] + i % (end - starts[at]);
    for (size_t k = starts[at]; i % 2 == 0 && k < end; ++k) {
      const auto sees = [&](size_t candidate) {
        return train::facing(avatar.body(), data.frames()[from[candidate].first],
                             data.cameras()[from[candidate].second].camera);
      };
      if (sees(k) > sees(pick)) pick = k;
    }
    chosen.push_back(from[pick]);
  }
  return chosen;
}

// The true picture and every avatar's, and the boxes of them that are shown.
struct Compared {
  std::vector<Picture> pictures;  // truth first
  Box person, face, hand;
};

// One frame as every avatar poses it.
using PosedFrames = std::vector<PosedFrame>;

Compared compare(const Avatars& avatars, const PosedFrames& posed, size_t frame, size_t camera) {
  train::TrainedAvatar& first = *avatars.front();
  const Camera& view = first.data().cameras()[camera].camera;
  Compared result;
  result.pictures.push_back(true_picture(first.data(), frame, camera));
  for (size_t i = 0; i < avatars.size(); ++i)
    result.pictures.push_back(render_picture(*avatars[i], posed[i], view));
  result.person = bounding_box(result.pictures.front());
  if (result.person.empty()) result.person = {0, 0, int(view.width_px), int(view.height_px)};
  result.face = projected_box(first.model(), posed.front().posed, view, head_joints(), 0);
  result.hand = projected_box(first.model(), posed.front().posed, view, left_hand_joints(), 0);
  return result;
}

// The camera of head and shoulders that sees most of the face, of those whose picture of this frame
// is held out.
std::optional<size_t> bust_camera(const train::TrainedAvatar& avatar, size_t frame) {
  const dataset::Dataset& data = avatar.data();
  std::optional<size_t> best;
  float most = -2;
  for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
    if (data.cameras()[camera].framing != dataset::Framing::kBust ||
        data.role(frame, camera) == dataset::Role::kTrain || !data.has_image(frame, camera))
      continue;
    const float sees =
        train::facing(avatar.body(), data.frames()[frame], data.cameras()[camera].camera);
    if (sees > most) best = camera, most = sees;
  }
  return best;
}

// What stands in a group of columns of the sheet: the same pose as a whole, from near by, and in
// detail.
struct Columns {
  Compared body;
  std::optional<Compared> bust;
};

Columns make_columns(const Avatars& avatars, size_t frame, size_t camera) {
  PosedFrames posed;
  for (train::TrainedAvatar* const avatar : avatars) posed.push_back(pose_frame(*avatar, frame));
  Columns columns{compare(avatars, posed, frame, camera), {}};
  if (const std::optional<size_t> near = bust_camera(*avatars.front(), frame))
    columns.bust = compare(avatars, posed, frame, *near);
  return columns;
}

struct Rows {
  uint32_t tile_width, detail_width;
  bool busts;  // there is a row of them, of square tiles
};

void paste_column(const Columns& columns, size_t column, const ContactSheetOptions& options,
                  const Rows& rows, uint32_t x, ports::ImageU8& sheet) {
  const Compared& body = columns.body;
  const float aspect = float(rows.tile_width) / float(options.person_height_px);
  paste(body.pictures[column], framed(body.person, aspect, kPersonMargin), sheet, x, kGap_px,
        rows.tile_width, options.person_height_px);
  uint32_t y = options.person_height_px + 2 * kGap_px;
  if (rows.busts) {
    if (columns.bust && !columns.bust->face.empty()) {
      paste(columns.bust->pictures[column], framed(columns.bust->face, 1, kBustMargin), sheet, x, y,
            rows.tile_width, rows.tile_width);
    }
    y += rows.tile_width + kGap_px;
  }
  for (const Box& detail : {body.face, body.hand}) {
    const float detail_aspect = float(rows.detail_width) / float(options.detail_height_px);
    if (!detail.empty()) {
      paste(body.pictures[column], framed(detail, detail_aspect, kDetailMargin), sheet,
            x + (rows.tile_width - rows.detail_width) / 2, y, rows.detail_width,
            options.detail_height_px);
    }
    y += options.detail_height_px + kGap_px;
  }
}

void check_avatars(const Avatars& avatars) {
  if (avatars.empty()) throw InputError("a contact sheet needs an avatar");
  const dataset::Dataset& data = avatars.front()->data();
  for (const train::TrainedAvatar* const avatar : avatars) {
    if (avatar->data().directory() != data.directory()) {
      throw InputError(avatar->data().directory() + ": a contact sheet shows one capture, " +
                       data.directory() + " is another");
    }
  }
}

}  // namespace

ports::ImageU8 make_contact_sheet(const Avatars& avatars, const ContactSheetOptions& options) {
  check_avatars(avatars);
  std::vector<Columns> poses;
  float aspect = 0.3f;  // width over height of the widest person
  bool busts = false;
  for (const auto& [frame, camera] : choose_pictures(*avatars.front(), options.poses)) {
    poses.push_back(make_columns(avatars, frame, camera));
    busts = busts || poses.back().bust.has_value();
    const Box& person = poses.back().body.person;
    aspect = std::max(aspect, float(person.x1 - person.x0) / float(person.y1 - person.y0));
  }
  const auto tile_width =
      static_cast<uint32_t>(std::ceil(aspect * float(options.person_height_px)));
  const Rows rows{tile_width, std::min(tile_width, options.detail_height_px), busts};
  const auto count = static_cast<uint32_t>(avatars.size() + 1);
  const uint32_t pose_width = count * (tile_width + kGap_px / 2) + kGap_px;
  const uint32_t height = options.person_height_px + 2 * options.detail_height_px + 4 * kGap_px +
                          (busts ? tile_width + kGap_px : 0);
  ports::ImageU8 sheet(pose_width * uint32_t(poses.size()) + kGap_px, height, 3);
  std::fill(sheet.pixels.begin(), sheet.pixels.end(), uint8_t{255});
  for (uint32_t i = 0; i < poses.size(); ++i) {
    for (uint32_t column = 0; column < count; ++column) {
      const uint32_t x = kGap_px + i * pose_width + column * (tile_width + kGap_px / 2);
      paste_column(poses[i], column, options, rows, x, sheet);
    }
  }
  return sheet;
}

}  // namespace figurine::pictures
