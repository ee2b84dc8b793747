/* figurine in C: packages from memory, avatars and their poses in, pixels out, and new avatars from
 * a seed. The whole of it is here; the headers of figurine/ are the same in C++.
 * docs/embedding.md shows how to embed it.
 *
 * Handles are numbers, zero is none. A handle of what was removed is refused with a message and
 * never followed, whatever came after it at the same place. Whatever is still in use cannot be
 * removed: the call says so, and nothing happens.
 *
 * Structs begin with their size, and come from fig_default_NAME(), which fills that in with every
 * other default: so a program goes on to run with later versions, whose structs are longer. That
 * is true of structs that a function fills as well. Where a struct is an option, NULL stands for
 * its default.
 *
 * Functions return FIG_OK or what went wrong; fig_last_message() then says it in one line, and
 * nothing was changed. There are no exceptions, files, clocks or environment. Different handles may
 * be used by different threads at a time; one renderer or sampler by one thread at a time (another
 * is refused); packages and sampled avatars by any number.
 *
 * Enumerations end in ..._MAX_ENUM, which is no value: it keeps them 32 bits wide.
 *
 * Units: metres, seconds, degrees where named so; right-handed axes with y up; camera axes x right,
 * y down, z forward; pixel centres at +0.5. Quaternions are w, x, y, z. Letters: J joints, n
 * Gaussians, d their degree of spherical harmonics (SH). */
#ifndef FIGURINE_H
#define FIGURINE_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define FIG_API __attribute__((visibility("default")))
#else
#define FIG_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* fig_NAME fig_default_NAME(void): the size is that of the program's own struct. For languages that
 * read no inline functions, the one behind it is there. */
#define FIG_DEFAULT(name)                                                      \
  FIG_API void fig_set_default_##name(fig_##name* value, size_t struct_bytes); \
  static inline fig_##name fig_default_##name(void) {                          \
    fig_##name value;                                                          \
    fig_set_default_##name(&value, sizeof value);                              \
    return value;                                                              \
  }

#define FIG_VERSION_MAJOR 0
#define FIG_VERSION_MINOR 2
#define FIG_VERSION_PATCH 0

FIG_API const char* fig_version(void);         /* of the library: "0.2.0" */
FIG_API const char* fig_network_library(void); /* what evaluates networks: "XNNPACK 0.20241108" */

/* ---- Errors ---------------------------------------------------------------------------------- */

typedef enum fig_status {
  FIG_OK = 0,
  FIG_INVALID_ARGUMENT = 1, /* a value that no input may have; a handle that is none */
  FIG_NOT_FOUND = 2,        /* a member that does not exist */
  FIG_CORRUPT = 3,          /* bytes that contradict themselves */
  FIG_UNSUPPORTED = 4,      /* sound, but not for this build, version or CPU */
  FIG_MISMATCH = 5,         /* two sound things that do not belong together: avatar and body */
  FIG_LIMIT_EXCEEDED = 6,   /* larger than allowed */
  FIG_IO = 7,               /* the operating system said no */
  FIG_OUT_OF_MEMORY = 8,
  FIG_INTERRUPTED = 9,
  FIG_STATUS_MAX_ENUM = 0x7fffffff
} fig_status;

FIG_API const char* fig_status_name(fig_status status); /* "invalid argument", ... */

/* What the last call on this thread that failed had to say, without a line's end; "" before any
 * did. Valid until the next call that fails on this thread. */
FIG_API const char* fig_last_message(void);

/* Told of a broken contract in figurine itself or in C++ code that uses it, in one line, before the
 * program aborts; without one the line goes to stderr. NULL takes it back. Set it before other
 * threads use figurine. */
typedef void (*fig_check_handler)(const char* message, void* user);
FIG_API void fig_set_check_handler(fig_check_handler handler, void* user);

/* ---- Instruction sets ------------------------------------------------------------------------ */

/* All give the same pixels; they differ in time alone. */
typedef enum fig_isa {
  FIG_ISA_BEST = 0,     /* the largest that this build and this CPU have */
  FIG_ISA_BASELINE = 1, /* what every CPU of the architecture has: SSE2 or NEON */
  FIG_ISA_NEON = 2,
  FIG_ISA_SSE41 = 3,
  FIG_ISA_AVX2 = 4,
  FIG_ISA_AVX512 = 5,
  FIG_ISA_MAX_ENUM = 0x7fffffff
} fig_isa;

FIG_API const char* fig_isa_name(fig_isa isa); /* "best", "baseline", "avx2", ... */
FIG_API int fig_isa_supported(fig_isa isa);    /* 1 if this build and this CPU have it */

/* ---- Packages -------------------------------------------------------------------------------- */

typedef struct fig_package {
  uint64_t id;
} fig_package;

typedef enum fig_package_kind {
  FIG_PACKAGE_BODY = 1,
  FIG_PACKAGE_AVATAR = 2,
  FIG_PACKAGE_MOTION = 3,
  FIG_PACKAGE_POPULATION = 4,
  FIG_PACKAGE_SAMPLER = 5,
  FIG_PACKAGE_KIND_MAX_ENUM = 0x7fffffff
} fig_package_kind;

typedef struct fig_package_options {
  size_t struct_bytes;
  const char* name; /* in front of messages about it, a file's name for example; "package" */
  int copy;         /* 0: the bytes are borrowed, must start at a multiple of 64 and stay unchanged
                       until fig_package_close; 1: the library keeps a copy of its own */
  int for_drawing;  /* 1: only what drawing takes is verified and read, of an avatar that has its
                       network in floats and in fixed point the latter, and what poses it knows;
                       0: everything */
} fig_package_options;
FIG_DEFAULT(package_options)

/* Opens a package and verifies all that is wanted of it; after that, nothing that reads it can
 * fail. */
FIG_API fig_status fig_package_open(const void* bytes, size_t size_bytes,
                                    const fig_package_options* options, fig_package* package);
/* FIG_INVALID_ARGUMENT while an avatar of a renderer, a sampler or a sampled avatar uses it. */
FIG_API fig_status fig_package_close(fig_package package);

typedef struct fig_package_info {
  size_t struct_bytes;
  fig_package_kind kind;
  const char* name;         /* of the content, valid while the package is open */
  uint64_t content_hash[2]; /* XXH3-128, low and high: names the whole content */
  uint64_t body_hash[2];    /* content_hash of the body that it stands on; 0 of a body or motion */
  uint64_t peak_memory_bytes; /* of the runtime for one instance, image and package excluded; 0: not
                                 applicable */
  uint64_t macs_per_frame;    /* multiplications with an addition */
  uint32_t gaussians;         /* a frame */
  uint32_t joint_count;       /* J, of a pose for it */
  uint32_t member_count;      /* of a population */
  uint32_t frame_count;       /* of a motion */
  float frames_per_second;    /* of a motion */
  int holds_f32, holds_q8;    /* 1 if its network, or its members', is there in this precision */
} fig_package_info;
FIG_DEFAULT(package_info)
FIG_API fig_status fig_package_get_info(fig_package package, fig_package_info* info);

typedef struct fig_joint {
  size_t struct_bytes;
  const char* name;         /* valid while the package is open */
  int32_t parent;           /* an earlier joint; -1 of the root, joint 0 */
  float rest_position_m[3]; /* of the mean template */
} fig_joint;
FIG_DEFAULT(joint)
FIG_API fig_status fig_package_joint(fig_package body, uint32_t joint, fig_joint* info);

/* A population's members, by number from 0 to member_count - 1. */
FIG_API fig_status fig_package_member_name(fig_package population, uint32_t member,
                                           const char** name); /* valid while it is open */
/* A member by its name, or if none is called so by its number in decimal digits. */
FIG_API fig_status fig_package_find_member(fig_package population, const char* name_or_number,
                                           uint32_t* member);

/* ---- Poses and cameras ----------------------------------------------------------------------- */

typedef struct fig_pose {
  size_t struct_bytes;
  float root_translation_m[3]; /* of the root joint from its rest position */
  uint32_t joint_count;        /* J, as the body has it */
  const float* rotations;      /* [J,4] quaternions relative to the parent joint, of any length */
} fig_pose;
FIG_DEFAULT(pose)

typedef struct fig_camera {
  size_t struct_bytes;
  uint32_t width_px, height_px;
  float fx_px, fy_px;        /* focal lengths */
  float cx_px, cy_px;        /* principal point; the image's centre is (width / 2, height / 2) */
  float view_from_world[12]; /* [3,4] row-major: x_view = R x_world + t, R a rotation */
  float near_m;              /* what is nearer is not drawn */
} fig_camera;
FIG_DEFAULT(camera)

typedef struct fig_orbit {
  size_t struct_bytes;
  float azimuth_deg;   /* 0 sees the front of a figure that faces +z; positive goes to its left */
  float elevation_deg; /* positive goes up; within [-90, 90] */
  float distance_m;    /* from the target */
  float vertical_fov_deg; /* 1 to 170 */
  float target_m[3];
} fig_orbit;
FIG_DEFAULT(orbit)

/* A camera on a sphere around the target that looks at it. */
FIG_API fig_status fig_make_orbit_camera(const fig_orbit* orbit, uint32_t width_px,
                                         uint32_t height_px, fig_camera* camera);

/* The pose and the camera in which an avatar, a sampler's avatars or a population's member (member;
 * otherwise 0) are known to look well. rotations is valid while the package is open. Either of
 * camera and pose may be NULL. */
FIG_API fig_status fig_package_golden_view(fig_package package, uint32_t member, fig_camera* camera,
                                           fig_pose* pose);
/* The pose of a motion's frame. rotations is valid while the package is open. */
FIG_API fig_status fig_package_motion_pose(fig_package motion, uint32_t frame, fig_pose* pose);

/* ---- Renderers and their avatars ------------------------------------------------------------- */

typedef struct fig_threads {
  uint64_t id;
} fig_threads;

typedef struct fig_renderer {
  uint64_t id;
} fig_renderer;

typedef struct fig_avatar {
  uint64_t id;
} fig_avatar;

typedef struct fig_sampled {
  uint64_t id;
} fig_sampled;

/* Threads that several renderers share: 1 to 64, the caller's own counted, and no more than there
 * are CPUs. Networks run on the caller's alone in a process that had loaded XNNPACK before this
 * library (docs/embedding.md, "Threads"). */
FIG_API fig_status fig_threads_create(uint32_t threads, fig_threads* created);
/* FIG_INVALID_ARGUMENT while a renderer uses them. */
FIG_API fig_status fig_threads_destroy(fig_threads threads);

typedef struct fig_renderer_options {
  size_t struct_bytes;
  uint32_t threads; /* 1 to 64, the caller's own counted, no more than there are CPUs; 1 */
  fig_threads pool; /* shared ones in their place, or zero */
  fig_isa isa;      /* FIG_ISA_BEST */
  /* Nanoseconds from any start, for fig_statistics; called by all threads. NULL: times are 0. */
  uint64_t (*now_ns)(void* now_user);
  void* now_user;
} fig_renderer_options;
FIG_DEFAULT(renderer_options)

FIG_API fig_status fig_renderer_create(const fig_renderer_options* options, fig_renderer* renderer);
/* With all of its avatars, whose handles are refused from then on. */
FIG_API fig_status fig_renderer_destroy(fig_renderer renderer);

typedef enum fig_precision {
  FIG_PRECISION_DEFAULT = 0, /* fixed point where the avatar has it, otherwise float */
  FIG_PRECISION_F32 = 1,
  FIG_PRECISION_Q8 = 2, /* fixed point: the same pixels on every CPU */
  FIG_PRECISION_MAX_ENUM = 0x7fffffff
} fig_precision;

typedef struct fig_avatar_options {
  size_t struct_bytes;
  fig_precision precision;
} fig_avatar_options;
FIG_DEFAULT(avatar_options)

/* Readies an avatar for frames: an avatar package, or member `member` of a population (in float
 * alone; of an avatar, 0). Both packages stay open until it is removed. An avatar that is added
 * again costs nothing but the call. */
FIG_API fig_status fig_renderer_add_avatar(fig_renderer renderer, fig_package package,
                                           uint32_t member, fig_package body,
                                           const fig_avatar_options* options, fig_avatar* avatar);
/* The same of an avatar out of a sampler. */
FIG_API fig_status fig_renderer_add_sampled(fig_renderer renderer, fig_sampled sampled,
                                            fig_package body, const fig_avatar_options* options,
                                            fig_avatar* avatar);
FIG_API fig_status fig_renderer_remove_avatar(fig_renderer renderer, fig_avatar avatar);

typedef struct fig_renderer_info {
  size_t struct_bytes;
  uint32_t threads;      /* that frames are drawn with */
  fig_isa isa;           /* of the kernels that run */
  uint32_t avatar_count; /* that are there now */
  uint64_t memory_bytes; /* held now, the network library's part estimated */
} fig_renderer_info;
FIG_DEFAULT(renderer_info)
FIG_API fig_status fig_renderer_get_info(fig_renderer renderer, fig_renderer_info* info);
/* FIG_PRECISION_F32 or FIG_PRECISION_Q8. */
FIG_API fig_status fig_renderer_avatar_precision(fig_renderer renderer, fig_avatar avatar,
                                                 fig_precision* precision);

/* ---- Frames ---------------------------------------------------------------------------------- */

typedef enum fig_pixel_format {
  FIG_PIXEL_RGBA8 = 0,    /* as stored (sRGB), straight alpha, rounded to nearest */
  FIG_PIXEL_RGBA_F32 = 1, /* the same, neither rounded nor clamped */
  FIG_PIXEL_BGRA8 = 2,
  /* From here on without alpha: a frame in them needs a background. */
  FIG_PIXEL_RGB24 = 3,
  FIG_PIXEL_BGR24 = 4,
  FIG_PIXEL_YUYV = 5, /* 4:2:2, Y Cb Y Cr, limited range; even width */
  FIG_PIXEL_NV12 = 6, /* 4:2:0, a plane of Y and one of Cb Cr, limited range; even width, height */
  FIG_PIXEL_FORMAT_MAX_ENUM = 0x7fffffff
} fig_pixel_format;

typedef enum fig_matrix {
  FIG_MATRIX_BT709 = 0,
  FIG_MATRIX_BT601 = 1,
  FIG_MATRIX_MAX_ENUM = 0x7fffffff
} fig_matrix;

/* Where a frame goes: the camera's height rows of stride_bytes, top row first. */
typedef struct fig_image {
  size_t struct_bytes;
  void* pixels;
  size_t stride_bytes;
  fig_pixel_format format; /* FIG_PIXEL_RGBA8 */
  void* chroma; /* FIG_PIXEL_NV12 alone: height / 2 rows of Cb and Cr, width bytes each */
  size_t chroma_stride_bytes; /* of those rows */
  fig_matrix matrix;          /* of FIG_PIXEL_YUYV and FIG_PIXEL_NV12; FIG_MATRIX_BT709 */
} fig_image;
FIG_DEFAULT(image)

/* An avatar in its pose. In an array all elements have the first's struct_bytes. */
typedef struct fig_frame_avatar {
  size_t struct_bytes;
  fig_avatar avatar;
  const fig_pose* pose;
  fig_avatar coarse; /* the same person in less detail, for when it is small; {0}: none */
  /* 1: where the pose is farther out than 95 % of those that the avatar was trained on, its network
   * is shown a nearer one, while skinning keeps the true one; 0. Nothing changes where the package
   * does not say what it knows. */
  uint32_t keep_to_known;
} fig_frame_avatar;
FIG_DEFAULT(frame_avatar)

/* Gaussians in world space. In an array all elements have the first's struct_bytes. */
typedef struct fig_gaussians {
  size_t struct_bytes;
  uint32_t count;                 /* n */
  uint32_t sh_degree;             /* d, at most 3 */
  const float* position_m;        /* [n,3] */
  const float* covariance_factor; /* [n,9] row-major F: the covariance is F F^T */
  const float* opacity;           /* [n] in [0,1] */
  const float* sh;                /* [n,(d+1)^2,3] coefficients, RGB innermost */
} fig_gaussians;
FIG_DEFAULT(gaussians)

/* What a frame need not compute because nobody would see it. The picture is the same to the bit
 * with and without: a switch is for measuring what it is worth. */
typedef enum fig_leave_out {
  FIG_LEAVE_OUT_HIDDEN_TEXELS = 1, /* of avatars whose offsets have a bound */
  FIG_LEAVE_OUT_TRANSPARENT = 2,   /* Gaussians under the alpha cut */
  FIG_LEAVE_OUT_OUTSIDE = 4,       /* Gaussians that touch no pixel */
  FIG_LEAVE_OUT_MISSED_TILES = 8,  /* tiles of a Gaussian's box that its ellipse does not reach */
  FIG_LEAVE_OUT_STOPPED = 16,      /* what lies behind a tile that is opaque */
  FIG_LEAVE_OUT_UNCHANGED_NETWORKS = 32, /* runs for the pose of the last run */
  FIG_LEAVE_OUT_ALL = 63,
  FIG_LEAVE_OUT_MAX_ENUM = 0x7fffffff
} fig_leave_out;

/* Whether what widens a small Gaussian to the pixel grid is taken from its opacity: for Gaussians
 * that were trained so. */
typedef enum fig_antialiased {
  FIG_ANTIALIASED_AS_TRAINED = 0, /* avatars as their packages say, other Gaussians not */
  FIG_ANTIALIASED_OFF = 1,
  FIG_ANTIALIASED_ON = 2,
  FIG_ANTIALIASED_MAX_ENUM = 0x7fffffff
} fig_antialiased;

typedef struct fig_frame {
  size_t struct_bytes;
  const fig_camera* camera;
  const fig_frame_avatar* avatars; /* [avatar_count]; NULL for none */
  size_t avatar_count;
  const fig_gaussians* gaussians; /* [gaussians_count] static sets; NULL for none */
  size_t gaussians_count;
  const float* background;     /* [3] RGB in [0,1], opaque; NULL: the image keeps its alpha */
  float alpha_cut;             /* contributions below it are skipped; in (0, 0.5]; 1/255 */
  uint32_t leave_out;          /* bits of fig_leave_out; FIG_LEAVE_OUT_ALL */
  fig_antialiased antialiased; /* FIG_ANTIALIASED_AS_TRAINED */
  /* What a frame may leave out although it shows (figurine/frame.h, Approximation). */
  float network_below_px; /* smaller figures keep what their network said of an earlier pose; 0 */
  uint32_t fast_blend;    /* 1: the blend's fast tier, over 50 dB from the exact picture; 0 */
  uint32_t network_interval; /* networks run for one of so many poses, and go on in between; 1 */
  float coarse_below_px;     /* smaller figures are drawn by fig_frame_avatar::coarse; 0 */
  float averted_above;       /* cosine above which texels facing away are left out; 1 */
  uint32_t sh_degree;        /* bands of spherical harmonics above it are left out; 3 */
} fig_frame;
FIG_DEFAULT(frame)

/* Draws a frame. After an error nothing was drawn. Allocates nothing once a frame of the same
 * content was drawn, and gives the same pixels for any number of threads. */
FIG_API fig_status fig_renderer_render(fig_renderer renderer, const fig_frame* frame,
                                       const fig_image* image);

/* The Gaussians of an avatar in a pose, as a frame would show them; valid until the next call with
 * this renderer. */
FIG_API fig_status fig_renderer_pose_avatar(fig_renderer renderer, fig_avatar avatar,
                                            const fig_pose* pose, fig_gaussians* gaussians);

/* How unusual a pose is to an avatar. */
typedef struct fig_pose_rarity {
  size_t struct_bytes;
  int known;          /* 0: the package does not say what poses it knows, and the rest is 0 */
  float distance;     /* from the mean of the training poses, in their own deviations */
  float share_beyond; /* of the training poses, those that are farther out; 0 to 1 */
} fig_pose_rarity;
FIG_DEFAULT(pose_rarity)
/* Allocates nothing. */
FIG_API fig_status fig_renderer_pose_rarity(fig_renderer renderer, fig_avatar avatar,
                                            const fig_pose* pose, fig_pose_rarity* rarity);

/* What the last frame came to. Times are of all threads together and need now_ns. */
typedef struct fig_statistics {
  size_t struct_bytes;
  uint64_t maps_ns, network_ns, decode_ns, skin_ns, project_ns, bin_ns, sort_ns, blend_ns,
      resolve_ns;
  uint64_t gaussians; /* given to projection */
  uint64_t visible;   /* Gaussians left after culling */
  uint64_t pairs;     /* of a Gaussian and a tile */
  uint64_t blends;    /* contributions blended into pixels */
  uint64_t macs;      /* of networks */
  /* Left out: texels; Gaussians; Gaussians; pairs of boxes; pairs behind opaque tiles. */
  uint64_t hidden_texels, transparent, outside, missed_tiles, stopped;
  uint64_t pulled_poses; /* of avatars whose network was shown another (keep_to_known) */
} fig_statistics;
FIG_DEFAULT(statistics)
FIG_API fig_status fig_renderer_statistics(fig_renderer renderer, fig_statistics* statistics);

/* ---- Sampling -------------------------------------------------------------------------------- */

typedef struct fig_sampler {
  uint64_t id;
} fig_sampler;

typedef struct fig_sampler_options {
  size_t struct_bytes;
  fig_isa isa; /* FIG_ISA_BEST */
} fig_sampler_options;
FIG_DEFAULT(sampler_options)

/* Of a sampler package, which stays open until the sampler is destroyed. */
FIG_API fig_status fig_sampler_create(fig_package package, const fig_sampler_options* options,
                                      fig_sampler* sampler);
FIG_API fig_status fig_sampler_destroy(fig_sampler sampler);

typedef enum fig_solver {
  FIG_SOLVER_DEFAULT = 0, /* the package's */
  FIG_SOLVER_DDIM = 1,
  FIG_SOLVER_DPMPP2M = 2,
  FIG_SOLVER_MAX_ENUM = 0x7fffffff
} fig_solver;

typedef struct fig_sample_options {
  size_t struct_bytes;
  uint64_t seed;
  uint64_t to;    /* another seed, and */
  double mix;     /* how far towards it the start lies, 0 to 1; 0 */
  uint32_t steps; /* 1 to 1000; 0: the package's */
  fig_solver solver;
} fig_sample_options;
FIG_DEFAULT(sample_options)

/* The avatar of a seed: the same weights on every CPU. It outlives the sampler, but keeps the
 * package open until it is destroyed. */
FIG_API fig_status fig_sampler_sample(fig_sampler sampler, const fig_sample_options* options,
                                      fig_sampled* sampled);
/* FIG_INVALID_ARGUMENT while a renderer's avatar uses it. */
FIG_API fig_status fig_sampled_destroy(fig_sampled sampled);

typedef struct fig_sampled_info {
  size_t struct_bytes;
  uint32_t convolution_count;
  uint32_t shape_count;
  const float* shape;       /* [shape_count] coefficients; arrays are valid until it is destroyed */
  uint64_t weights_hash[2]; /* XXH3-128 of all that the avatar in fixed point is decided by */
} fig_sampled_info;
FIG_DEFAULT(sampled_info)
FIG_API fig_status fig_sampled_get_info(fig_sampled sampled, fig_sampled_info* info);

/* One convolution of its network, in float and in fixed point. */
typedef struct fig_convolution {
  size_t struct_bytes;
  uint32_t out_channels, kernel, in_channels;
  const float* weights;     /* [out,kernel,kernel,in] */
  const float* bias;        /* [out] */
  const int8_t* q8_weights; /* [out,kernel,kernel,in], times q8_scale of the output */
  const float* q8_scale;    /* [out] */
  const int32_t* q8_bias;   /* [out] */
} fig_convolution;
FIG_DEFAULT(convolution)
FIG_API fig_status fig_sampled_convolution(fig_sampled sampled, uint32_t convolution,
                                           fig_convolution* info);

#ifdef __cplusplus
}
#endif

#endif /* FIGURINE_H */
