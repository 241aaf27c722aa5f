/* The engine for C, and for whoever calls C: scenes that stay open, and gathers at receivers in
   memory. surfeit/engine.h has the same for C++, and says more about what things mean.

   Conventions
   - C99. Handles are opaque; each has a release function, which takes NULL. A handle holds what it
     needs: the order of releases does not matter.
   - Functions that can fail return a surfeit_code. SURFEIT_OK is 0; other values never change. The
     text of the last failure of the calling thread is surfeit_last_error().
   - Structs that callers fill in begin with `size`, which must be sizeof the struct; their init
     function sets it, and the defaults. Later versions append members and read what older callers
     have.
   - Results through pointers are set on success alone, but for arrays of results, which may be
     filled in part.
   - Strings are UTF-8, as the system's file names; NULL is none.
   - Any function may be called from any thread, but calls on one surfeit_gatherer must not overlap.
   - Nothing is thrown, printed, or done at load or exit. */
#ifndef SURFEIT_SURFEIT_H
#define SURFEIT_SURFEIT_H

#include <stddef.h>
#include <stdint.h>

#include "surfeit/api.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum surfeit_code {
  SURFEIT_OK = 0,
  SURFEIT_INVALID_ARGUMENT = 1, /* an option or a call that cannot work */
  SURFEIT_CORRUPTION = 2,       /* bytes that are not what the format says */
  SURFEIT_BUDGET_TOO_SMALL = 3, /* the text has the budget that would do */
  SURFEIT_IO_ERROR = 4,         /* the system refused to open or read */
  SURFEIT_INTERRUPTED = 5,      /* the caller asked to stop */
  SURFEIT_FAILED = 6            /* anything else: out of memory, for one */
} surfeit_code;

/* The text of the last call in this thread that failed: one line, what, where, found and expected.
   Valid until the next call that fails in this thread. Empty before the first. */
SURFEIT_API const char* surfeit_last_error(void);

/* "0.1.0". */
SURFEIT_API const char* surfeit_version(void);

/* ---- Engine ---- */

typedef struct surfeit_engine surfeit_engine;
typedef struct surfeit_scene surfeit_scene;
typedef struct surfeit_gatherer surfeit_gatherer;

typedef struct surfeit_engine_options {
  size_t size;
  uint64_t
      memory_bytes;  /* budget of pages, directories, gatherers; 0: 3/4 of what the job may use */
  int32_t threads;   /* gatherers that are expected at a time; 0: as many as processors */
  int32_t direct_io; /* 1: read past the page cache of the system */
} surfeit_engine_options;
SURFEIT_API void surfeit_engine_options_init(surfeit_engine_options* options);

/* `options` may be NULL. */
SURFEIT_API surfeit_code surfeit_engine_create(const surfeit_engine_options* options,
                                               surfeit_engine** engine);
SURFEIT_API void surfeit_engine_release(surfeit_engine* engine);

typedef struct surfeit_cache_statistics {
  uint64_t requests, hits, misses;    /* page look-ups; loads that a thread waited for */
  uint64_t repeated_loads;            /* of pages that had been evicted */
  uint64_t bytes_read;                /* stored bytes of all loads */
  uint64_t budget_bytes;              /* frames that the cache may fill */
  double load_seconds, stall_seconds; /* summed over threads */
} surfeit_cache_statistics;

typedef struct surfeit_statistics {
  size_t size;
  uint64_t receivers;                /* gathered by all gatherers */
  uint64_t memory_bytes, held_bytes; /* the budget; of it directories, tables and gatherers */
  uint32_t scenes, gatherers;        /* that are open, that exist */
  surfeit_cache_statistics node_cache, surfel_cache;
} surfeit_statistics;
/* `statistics->size` must be set. */
SURFEIT_API surfeit_code surfeit_engine_statistics(const surfeit_engine* engine,
                                                   surfeit_statistics* statistics);

/* ---- Scenes ---- */

/* Opens a paged octree file. The second takes its bytes, which are copied; `name` begins messages
   about it. */
SURFEIT_API surfeit_code surfeit_scene_open(surfeit_engine* engine, const char* path,
                                            surfeit_scene** scene);
SURFEIT_API surfeit_code surfeit_scene_open_bytes(surfeit_engine* engine, const void* bytes,
                                                  size_t byte_count, const char* name,
                                                  surfeit_scene** scene);
SURFEIT_API void surfeit_scene_release(surfeit_scene* scene);

typedef struct surfeit_scene_info {
  size_t size;
  uint64_t file_bytes, surfels, nodes;
  uint64_t groups;       /* set of those that surfels have, as bits */
  double min[3], max[3]; /* of the surfels' positions, scene units */
  int32_t up_axis;       /* 1: y, 2: z */
} surfeit_scene_info;
/* `info->size` must be set. */
SURFEIT_API surfeit_code surfeit_scene_get_info(const surfeit_scene* scene,
                                                surfeit_scene_info* info);

/* ---- Gathers ---- */

enum { SURFEIT_OCCLUSION = 0, SURFEIT_BLEEDING = 1, SURFEIT_GLOSSY = 2 }; /* mode */
enum { SURFEIT_DRAFT = 0, SURFEIT_STANDARD = 1, SURFEIT_FINAL = 2 };      /* quality */
enum { SURFEIT_FRONT = 0, SURFEIT_BOTH = 1, SURFEIT_BACK = 2 };           /* sides */
enum { SURFEIT_COSINE = 0, SURFEIT_UNIFORM = 1 };                         /* distribution */
enum { SURFEIT_EXPONENTIAL = 0, SURFEIT_POLYNOMIAL = 1 };                 /* falloff_mode */

/* Outputs, as bits. Light is in units of radiosity: E = pi * mean radiance. */
enum {
  SURFEIT_OUTPUT_OCCLUSION = 1,
  SURFEIT_OUTPUT_IRRADIANCE = 2,
  SURFEIT_OUTPUT_BENT_NORMAL = 4,
  SURFEIT_OUTPUT_ILLUMINATION_DIRECTION = 8,
  SURFEIT_OUTPUT_ENVIRONMENT = 16,
  SURFEIT_OUTPUT_FLUENCE = 32,
  SURFEIT_OUTPUT_RADIANCE_SH = 64
};

typedef struct surfeit_settings {
  size_t size;
  int32_t mode;
  uint32_t outputs; /* 0: occlusion, and light unless SURFEIT_OCCLUSION */
  uint64_t groups;  /* set of the groups that are seen; all bits: all */
  double eye[3];    /* of SURFEIT_GLOSSY; NaN: every receiver has its view */

  float max_solid_angle;     /* steradians, >= 0; 0 opens every node */
  int32_t raster_resolution; /* pixels along an edge of a cube face, even, 2 to 64 */
  float bias;                /* in radii of the surfel looked at */
  float near_field_radii;    /* closer than this many radii surfels are ray traced */
  float max_distance;        /* scene units */
  int32_t sides;
  float max_variation; /* results may be interpolated where they vary less; 0: off */

  int32_t distribution; /* of directions; not with SURFEIT_GLOSSY */
  float cone_angle;     /* radians, to pi / 2; 0: the hemisphere, or the lobe */
  float roughness;      /* of SURFEIT_GLOSSY, over 0 to 1 */
  float falloff;        /* of occlusion with distance; 0: none */
  int32_t falloff_mode;
} surfeit_settings;
/* Occlusion at standard quality. */
SURFEIT_API void surfeit_settings_init(surfeit_settings* settings);
/* Sets max solid angle, raster resolution and near field. */
SURFEIT_API surfeit_code surfeit_settings_set_quality(surfeit_settings* settings, int32_t quality);

/* Where a scene stands: x' = m[0] x + m[1] y + m[2] z + m[3] and so on; a proper rotation times one
   scale over 0, and a shift. */
typedef struct surfeit_instance {
  const surfeit_scene* scene;
  double m[12];
} surfeit_instance;

/* Light from all around, in memory: a lat-long picture, twice as wide as high, the top row up;
   radiances r g b, finite and not negative. */
typedef struct surfeit_environment {
  size_t size;
  int32_t width, height;
  const float* pixels; /* 3 * width * height, copied */
  float rotation;      /* about the up axis, radians, counterclockwise from above */
  float intensity;     /* multiplies it */
  int32_t up_axis;     /* 1: y, 2: z, -1: that of the first scene */
} surfeit_environment;
SURFEIT_API void surfeit_environment_init(surfeit_environment* environment);

typedef struct surfeit_receiver {
  double position[3]; /* scene units */
  float normal[3];    /* of any length; zero: gathers over the whole sphere */
  float view[3];      /* with SURFEIT_GLOSSY, direction that it is looked along; zero: from eye */
} surfeit_receiver;

/* What was not asked for is zero. */
typedef struct surfeit_result {
  float occlusion; /* covered part, 0 to 1 */
  float irradiance[3];
  float bent_normal[3];
  float illumination_direction[3];
  float environment[3];
  float fluence[3];
  float radiance_sh[9][3];
} surfeit_result;

/* A gatherer of one scene in its own coordinates, or of several instances in one world. `settings`
   and `environment` may be NULL. One gatherer per thread. */
SURFEIT_API surfeit_code surfeit_gatherer_create(surfeit_engine* engine, const surfeit_scene* scene,
                                                 const surfeit_settings* settings,
                                                 const surfeit_environment* environment,
                                                 surfeit_gatherer** gatherer);
SURFEIT_API surfeit_code surfeit_gatherer_create_instances(surfeit_engine* engine,
                                                           const surfeit_instance* instances,
                                                           size_t instance_count,
                                                           const surfeit_settings* settings,
                                                           const surfeit_environment* environment,
                                                           surfeit_gatherer** gatherer);
/* Another one of the same world for another thread; they share what they can. */
SURFEIT_API surfeit_code surfeit_gatherer_clone(const surfeit_gatherer* gatherer,
                                                surfeit_gatherer** clone);
SURFEIT_API void surfeit_gatherer_release(surfeit_gatherer* gatherer);

/* Asked now and then whether to stop: 0 goes on. */
typedef int (*surfeit_cancel)(void* user);

/* Gathers at `count` receivers: thousands of calls of a few, or one of all. `cancel` may be NULL. A
   receiver that is not valid gets NaN. */
SURFEIT_API surfeit_code surfeit_gather(surfeit_gatherer* gatherer,
                                        const surfeit_receiver* receivers, size_t count,
                                        surfeit_result* results, surfeit_cancel cancel, void* user);
/* Lets go of the pages that it holds in front of the caches: for threads that pause. */
SURFEIT_API void surfeit_gatherer_pause(surfeit_gatherer* gatherer);

/* ---- Surfels ---- */

typedef struct surfeit_surfel {
  double position[3];
  float normal[3];    /* of any length; zero: a sphere */
  float radius;       /* > 0; 0: found from area, or from the neighbours */
  float area;         /* > 0; 0: found from radius, or from the neighbours */
  float radiosity[3]; /* scene-linear, >= 0 */
  float albedo[3];    /* 0 to 1 */
  int32_t two_sided;  /* 1: both sides send and block light */
  int32_t group;      /* 0 to 63 */
} surfeit_surfel;

typedef struct surfeit_index_options {
  size_t size;
  uint64_t memory_bytes;  /* of the job; 0: 1 GiB, or 3/4 of what it may hold */
  int32_t threads;        /* 0: all that the job may use */
  int32_t full_precision; /* 1: floats instead of quantized values */
} surfeit_index_options;
SURFEIT_API void surfeit_index_options_init(surfeit_index_options* options);

/* Writes the paged octree file of surfels in memory. It appears under its name only when complete.
   `options` may be NULL. */
SURFEIT_API surfeit_code surfeit_index_surfels(const surfeit_surfel* surfels, size_t count,
                                               const char* output,
                                               const surfeit_index_options* options);

#ifdef __cplusplus
}
#endif

#endif
