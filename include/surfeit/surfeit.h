/* The engine for C, and for languages that call C: it keeps scenes open and gathers at receivers in
   memory. surfeit/engine.h is the same for C++, and explains more.

   Conventions
   - C99. Handles are opaque. Each has a release function, which accepts NULL. A handle keeps alive
     whatever it needs: the order of releases does not matter.
   - Functions that can fail return a surfeit_code. SURFEIT_OK is 0; values never change.
     surfeit_last_error() returns the text of the last failure of the calling thread.
   - Structs that callers fill in begin with `size`, which must be sizeof the struct. Their init
     function sets it, and the defaults. Later versions append members, and accept the shorter
     structs of older callers.
   - Results through pointers are set only on success. Arrays of results are an exception: a failed
     call may have filled a part.
   - Strings are UTF-8, as are file names; NULL means none.
   - Any function may be called from any thread, but calls on one surfeit_gatherer must not overlap.
   - The library throws nothing, prints nothing, and does nothing at load or exit. */
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
  SURFEIT_CORRUPTION = 2,       /* bytes that break the rules of the format */
  SURFEIT_BUDGET_TOO_SMALL = 3, /* the text names the least budget that works */
  SURFEIT_IO_ERROR = 4,         /* the system refused to open or read */
  SURFEIT_INTERRUPTED = 5,      /* the caller asked to stop */
  SURFEIT_FAILED = 6            /* anything else: out of memory, for one */
} surfeit_code;

/* The text of the last failed call in this thread, one line: what, where, found and expected. Valid
   until the next failed call in this thread. Empty before the first. */
SURFEIT_API const char* surfeit_last_error(void);

/* "0.1.0". */
SURFEIT_API const char* surfeit_version(void);

/* ---- Engine ---- */

typedef struct surfeit_engine surfeit_engine;
typedef struct surfeit_scene surfeit_scene;
typedef struct surfeit_gatherer surfeit_gatherer;

typedef struct surfeit_engine_options {
  size_t size;
  uint64_t memory_bytes; /* budget of pages, directories, gatherers; 0: 3/4 of the job's memory */
  int32_t threads;       /* expected gatherers at a time; 0: as many as processors */
  int32_t direct_io;     /* 1: read past the page cache of the system */
  int32_t lobes;         /* 1: room for scenes of glossy bounces, which are refused without it */
} surfeit_engine_options;
SURFEIT_API void surfeit_engine_options_init(surfeit_engine_options* options);

/* `options` may be NULL. */
SURFEIT_API surfeit_code surfeit_engine_create(const surfeit_engine_options* options,
                                               surfeit_engine** engine);
SURFEIT_API void surfeit_engine_release(surfeit_engine* engine);

typedef struct surfeit_cache_statistics {
  uint64_t requests, hits, misses;    /* requests: page look-ups; misses: loads waited for */
  uint64_t repeated_loads;            /* of pages that had been evicted */
  uint64_t bytes_read;                /* stored bytes of all loads */
  uint64_t budget_bytes;              /* frames that the cache may fill */
  double load_seconds, stall_seconds; /* summed over threads */
} surfeit_cache_statistics;

typedef struct surfeit_statistics {
  size_t size;
  uint64_t receivers;                /* gathered by all gatherers */
  uint64_t memory_bytes, held_bytes; /* the budget; its part for directories, tables, gatherers */
  uint32_t scenes, gatherers;        /* open scenes, existing gatherers */
  surfeit_cache_statistics node_cache, surfel_cache;
} surfeit_statistics;
/* `statistics->size` must be set. */
SURFEIT_API surfeit_code surfeit_engine_statistics(const surfeit_engine* engine,
                                                   surfeit_statistics* statistics);

/* ---- Scenes ---- */

/* Opens a paged octree file. The second function takes the bytes of a file, and copies them;
   messages about the scene begin with `name`. */
SURFEIT_API surfeit_code surfeit_scene_open(surfeit_engine* engine, const char* path,
                                            surfeit_scene** scene);
SURFEIT_API surfeit_code surfeit_scene_open_bytes(surfeit_engine* engine, const void* bytes,
                                                  size_t byte_count, const char* name,
                                                  surfeit_scene** scene);
SURFEIT_API void surfeit_scene_release(surfeit_scene* scene);

typedef struct surfeit_scene_info {
  size_t size;
  uint64_t file_bytes, surfels, nodes;
  uint64_t groups;       /* object groups with surfels, as bits */
  double min[3], max[3]; /* bounds of the surfels' positions, scene units */
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

/* A factor of the light that surfels of an object group send, 0 to 1e6. */
typedef struct surfeit_group_gain {
  uint32_t group; /* 0 to 63 */
  float gain;
} surfeit_group_gain;

typedef struct surfeit_settings {
  size_t size;
  int32_t mode;
  uint32_t outputs; /* 0: occlusion, and light unless SURFEIT_OCCLUSION */
  uint64_t groups;  /* object groups that send light and cover, as bits; all bits: all */
  double eye[3];    /* viewpoint of SURFEIT_GLOSSY; NaN: every receiver has its own view */

  float max_solid_angle;     /* steradians, >= 0; 0 opens every node */
  int32_t raster_resolution; /* pixels along an edge of a cube face, even, 2 to 64 */
  float bias;                /* rays start this high, in radii of the surfel tested */
  float near_field_radii;    /* surfels closer than this many radii are ray traced */
  float max_distance;        /* scene units */
  int32_t sides;
  float max_variation; /* results may be interpolated where they vary less; 0: off */

  int32_t distribution; /* weights of directions; not with SURFEIT_GLOSSY */
  float cone_angle;     /* radians, up to pi / 2; 0: the hemisphere, or the lobe */
  float roughness;      /* of SURFEIT_GLOSSY, above 0, up to 1 */
  float falloff;        /* of occlusion with distance; 0: none */
  int32_t falloff_mode;

  size_t gain_count;               /* 0: every group sends its radiosity */
  const surfeit_group_gain* gains; /* no group twice; other groups have 1; copied */
} surfeit_settings;
/* Occlusion at standard quality. */
SURFEIT_API void surfeit_settings_init(surfeit_settings* settings);
/* Sets max solid angle, raster resolution and near field. */
SURFEIT_API surfeit_code surfeit_settings_set_quality(surfeit_settings* settings, int32_t quality);

/* A scene and its place in the world: x' = m[0] x + m[1] y + m[2] z + m[3] and so on; a proper
   rotation times one scale above 0, and a translation. */
typedef struct surfeit_instance {
  const surfeit_scene* scene;
  double m[12];
} surfeit_instance;

/* An environment picture in memory, light from infinitely far away: lat-long, twice as wide as
   high, the top row up; radiances r g b, finite and not negative. */
typedef struct surfeit_environment {
  size_t size;
  int32_t width, height;
  const float* pixels; /* 3 * width * height, copied */
  float rotation;      /* about the up axis, radians, counterclockwise from above */
  float intensity;     /* factor of its light */
  int32_t up_axis;     /* 1: y, 2: z, -1: the axis of the first scene */
} surfeit_environment;
SURFEIT_API void surfeit_environment_init(surfeit_environment* environment);

typedef struct surfeit_receiver {
  double position[3]; /* scene units */
  float normal[3];    /* of any length; zero: gathers over the whole sphere */
  float view[3];      /* with SURFEIT_GLOSSY, direction from the viewer to it; zero: from eye */
} surfeit_receiver;

/* Outputs that were not asked for are zero. */
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
/* Another gatherer of the same world for another thread; the two share data where they can. */
SURFEIT_API surfeit_code surfeit_gatherer_clone(const surfeit_gatherer* gatherer,
                                                surfeit_gatherer** clone);
SURFEIT_API void surfeit_gatherer_release(surfeit_gatherer* gatherer);

/* Polled during a gather: 0 goes on, other values stop it. */
typedef int (*surfeit_cancel)(void* user);

/* Gathers at `count` receivers, few or many per call. `cancel` may be NULL. A receiver that is not
   valid gets NaN. */
SURFEIT_API surfeit_code surfeit_gather(surfeit_gatherer* gatherer,
                                        const surfeit_receiver* receivers, size_t count,
                                        surfeit_result* results, surfeit_cancel cancel, void* user);
/* Releases the pages that the gatherer holds in front of the caches, for threads that pause. */
SURFEIT_API void surfeit_gatherer_pause(surfeit_gatherer* gatherer);

/* ---- Surfels ---- */

typedef struct surfeit_surfel {
  double position[3];
  float normal[3];    /* of any length; zero: a sphere */
  float radius;       /* > 0; 0: found from neighbours, and with an area from that, too */
  float area;         /* > 0; 0: found from radius, or, if no surfel has a size, from neighbours */
  float radiosity[3]; /* scene-linear, >= 0 */
  float albedo[3];    /* 0 to 1 */
  int32_t two_sided;  /* 1: both sides send and block light */
  int32_t group;      /* 0 to 63 */
} surfeit_surfel;

typedef struct surfeit_index_options {
  size_t size;
  uint64_t memory_bytes;  /* budget; 0: 1 GiB, or 3/4 of the job's memory if that is less */
  int32_t threads;        /* 0: all that the job may use */
  int32_t full_precision; /* 1: floats instead of quantized values */
} surfeit_index_options;
SURFEIT_API void surfeit_index_options_init(surfeit_index_options* options);

/* Writes a paged octree file from surfels in memory. It appears under its name only when complete.
   `options` may be NULL. The first surfel that is not valid (a number that is not finite, a
   negative size or radiosity) is refused, and the text names it. */
SURFEIT_API surfeit_code surfeit_index_surfels(const surfeit_surfel* surfels, size_t count,
                                               const char* output,
                                               const surfeit_index_options* options);

#ifdef __cplusplus
}
#endif

#endif
