/* figurine.h alone, in C11 with every warning an error: what a program in C sees. Called by
 * c_api_test. */
#include "figurine.h"

/* The number of structs whose default does not begin with their size, or that do not. */
int count_unsound_defaults(void) {
  int unsound = 0;
#define FIG_LOOK(type)                                                  \
  do {                                                                  \
    const fig_##type value = fig_default_##type();                      \
    unsound += value.struct_bytes != sizeof value;                      \
    unsound += (const void*)&value.struct_bytes != (const void*)&value; \
  } while (0)
  FIG_LOOK(package_options);
  FIG_LOOK(package_info);
  FIG_LOOK(joint);
  FIG_LOOK(pose);
  FIG_LOOK(camera);
  FIG_LOOK(orbit);
  FIG_LOOK(renderer_options);
  FIG_LOOK(avatar_options);
  FIG_LOOK(renderer_info);
  FIG_LOOK(image);
  FIG_LOOK(frame_avatar);
  FIG_LOOK(gaussians);
  FIG_LOOK(frame);
  FIG_LOOK(pose_rarity);
  FIG_LOOK(statistics);
  FIG_LOOK(sampler_options);
  FIG_LOOK(sample_options);
  FIG_LOOK(sampled_info);
  FIG_LOOK(convolution);
  return unsound;
}

/* A status and its message as C sees them: opens what is no package. */
fig_status open_nothing(void) {
  fig_package package;
  const char bytes[4] = {0, 0, 0, 0};
  fig_package_options options = fig_default_package_options();
  options.name = "four zeros";
  options.copy = 1;
  return fig_package_open(bytes, sizeof bytes, &options, &package);
}
