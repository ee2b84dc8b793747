#include "samples/common/golden_picture.h"

namespace figurine::samples {

Result<GoldenPicture> draw_golden_picture(const Avatar& avatar, const Package& body,
                                          std::optional<Precision> precision,
                                          const RendererOptions& options) {
  Result<std::unique_ptr<Renderer>> renderer = Renderer::create(options);
  if (!renderer.ok()) return renderer.status();
  const Result<AvatarId> id = (*renderer)->add_avatar(avatar, body, precision);
  if (!id.ok()) return id.status();
  const GoldenFrame& golden = avatar.golden;
  GoldenPicture picture{
      RenderedFrame({golden.camera.width_px, golden.camera.height_px}, PixelFormat::kRgba8), 0};
  const FrameAvatar posed[] = {
      {.avatar = *id, .pose = {golden.root_translation_m, golden.rotations}}};
  FIG_RETURN_IF_ERROR((*renderer)->render(
      {.camera = golden.camera, .avatars = posed, .background = golden.background},
      picture.frame.target()));
  picture.memory_bytes = (*renderer)->memory_bytes();
  return picture;
}

}  // namespace figurine::samples
