/* Every function of surfeit.h, from C99, built through pkg-config.

     c_consumer DIR */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <surfeit/surfeit.h>

#define EDGE 40

static int failures = 0;

static void expect(int condition, const char* what) {
  if (condition) return;
  fprintf(stderr, "c_consumer: %s (last error: %s)\n", what, surfeit_last_error());
  ++failures;
}

static int never(void* user) {
  ++*(int*)user;
  return 0;
}

static int at_once(void* user) {
  (void)user;
  return 1;
}

static void make_scene(const char* path) {
  surfeit_surfel* surfels = calloc(EDGE * EDGE, sizeof *surfels);
  surfeit_index_options options;
  int i;
  if (surfels == NULL) exit(1);
  for (i = 0; i < EDGE * EDGE; ++i) {
    surfels[i].position[0] = (i % EDGE + .5) / EDGE - .5;
    surfels[i].position[1] = 1;
    surfels[i].position[2] = (i / EDGE + .5) / EDGE - .5;
    surfels[i].normal[1] = -1;
    surfels[i].radius = .018f;
    surfels[i].area = 1.f / (EDGE * EDGE);
    surfels[i].radiosity[0] = 1;
  }
  surfeit_index_options_init(&options);
  options.memory_bytes = 64 << 20;
  options.threads = 1;
  expect(surfeit_index_surfels(surfels, EDGE * EDGE, path, &options) == SURFEIT_OK, "index");
  surfels[7].group = 64;
  expect(surfeit_index_surfels(surfels, EDGE * EDGE, path, &options) == SURFEIT_INVALID_ARGUMENT &&
             strstr(surfeit_last_error(), "group 64") != NULL,
         "a group out of range");
  expect(surfeit_index_surfels(NULL, 0, path, NULL) == SURFEIT_INVALID_ARGUMENT, "no surfels");
  free(surfels);
}

/* Surfels of which some lack a size that others have, and surfels that are not valid. */
static void index_odd_surfels(const char* path) {
  surfeit_surfel surfels[4];
  int i;
  memset(surfels, 0, sizeof surfels);
  for (i = 0; i < 4; ++i) {
    surfels[i].position[0] = i;
    surfels[i].normal[1] = -1;
    if (i % 2 == 0) surfels[i].radius = .5f;
    if (i % 2 == 1) surfels[i].area = .4f;
  }
  expect(surfeit_index_surfels(surfels, 4, path, NULL) == SURFEIT_OK, "some sizes");
  surfels[2].radius = 0;
  expect(surfeit_index_surfels(surfels, 4, path, NULL) == SURFEIT_INVALID_ARGUMENT &&
             strstr(surfeit_last_error(), "surfel 2") != NULL,
         "a surfel without the sizes that others have");
  surfels[2].radius = -1;
  expect(surfeit_index_surfels(surfels, 4, path, NULL) == SURFEIT_CORRUPTION &&
             strstr(surfeit_last_error(), "record 2") != NULL,
         "a surfel that is not valid");
}

static void* read_all(const char* path, size_t* size) {
  FILE* file = fopen(path, "rb");
  void* bytes;
  if (file == NULL) return NULL;
  fseek(file, 0, SEEK_END);
  *size = (size_t)ftell(file);
  rewind(file);
  bytes = malloc(*size);
  if (bytes == NULL || fread(bytes, 1, *size, file) != *size) exit(1);
  fclose(file);
  return bytes;
}

/* Surfels of group 0 send three times their light, and cover as before. */
static void gather_with_gains(surfeit_engine* engine, const surfeit_scene* scene,
                              surfeit_settings settings, const surfeit_receiver* receiver,
                              surfeit_result plain) {
  const surfeit_group_gain gains[2] = {{0, 3}, {0, 2}};
  surfeit_gatherer* gatherer = NULL;
  surfeit_result result;
  settings.gains = gains;
  settings.gain_count = 1;
  expect(surfeit_gatherer_create(engine, scene, &settings, NULL, &gatherer) == SURFEIT_OK, "gain");
  expect(surfeit_gather(gatherer, receiver, 1, &result, NULL, NULL) == SURFEIT_OK, "gather");
  expect(fabs(result.irradiance[0] - 3 * plain.irradiance[0]) < 1e-5, "light with a gain");
  expect(result.occlusion == plain.occlusion, "occlusion with a gain");
  surfeit_gatherer_release(gatherer);
  settings.gain_count = 2;
  expect(surfeit_gatherer_create(engine, scene, &settings, NULL, &gatherer) ==
             SURFEIT_INVALID_ARGUMENT,
         "two gains of a group");
  settings.gains = NULL;
  expect(surfeit_gatherer_create(engine, scene, &settings, NULL, &gatherer) ==
             SURFEIT_INVALID_ARGUMENT,
         "no gains");
}

/* A caller compiled before gains: what lies behind its struct is not read. */
static void gather_as_older_caller(surfeit_engine* engine, const surfeit_scene* scene,
                                   surfeit_settings settings, const surfeit_receiver* receiver,
                                   surfeit_result plain) {
  surfeit_gatherer* gatherer = NULL;
  surfeit_result result;
  settings.size = offsetof(surfeit_settings, gain_count);
  settings.gain_count = 99;
  expect(surfeit_gatherer_create(engine, scene, &settings, NULL, &gatherer) == SURFEIT_OK,
         "an older caller");
  expect(surfeit_gather(gatherer, receiver, 1, &result, NULL, NULL) == SURFEIT_OK, "gather");
  expect(result.irradiance[0] == plain.irradiance[0], "light of an older caller");
  surfeit_gatherer_release(gatherer);
  settings.size = sizeof settings + 8;
  expect(surfeit_gatherer_create(engine, scene, &settings, NULL, &gatherer) ==
             SURFEIT_INVALID_ARGUMENT,
         "a newer caller");
}

static void gather_from(surfeit_engine* engine, const surfeit_scene* scene) {
  surfeit_settings settings;
  surfeit_environment sky;
  surfeit_gatherer *gatherer = NULL, *clone = NULL, *moved = NULL;
  surfeit_instance instances[2] = {{NULL, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}},
                                   {NULL, {1, 0, 0, 100, 0, 1, 0, 0, 0, 0, 1, 0}}};
  surfeit_receiver receivers[2] = {{{0, 0, 0}, {0, 1, 0}, {0, 0, 0}},
                                   {{100, 0, 0}, {0, 2, 0}, {0, 0, 0}}};
  surfeit_result results[2], again;
  float* white = malloc(3 * 8 * 4 * sizeof *white);
  int asked = 0, i;
  if (white == NULL) exit(1);
  for (i = 0; i < 3 * 8 * 4; ++i) white[i] = 1;

  surfeit_settings_init(&settings);
  settings.mode = SURFEIT_BLEEDING;
  expect(surfeit_settings_set_quality(&settings, SURFEIT_FINAL) == SURFEIT_OK &&
             settings.raster_resolution == 40,
         "quality");
  expect(surfeit_settings_set_quality(&settings, 9) == SURFEIT_INVALID_ARGUMENT, "no quality");
  surfeit_environment_init(&sky);
  sky.width = 8;
  sky.height = 4;
  sky.pixels = white;

  expect(surfeit_gatherer_create(engine, scene, &settings, &sky, &gatherer) == SURFEIT_OK,
         "gatherer");
  free(white); /* it was copied */
  expect(surfeit_gather(gatherer, receivers, 2, results, never, &asked) == SURFEIT_OK, "gather");
  expect(asked > 0, "nobody asked whether to stop");
  expect(fabs(results[0].occlusion - .239) < .01, "occlusion of a square above");
  expect(fabs(results[0].irradiance[0] - .239) < .01 && results[0].irradiance[1] == 0, "light");
  expect(fabs(results[0].environment[1] - 3.14159 * .761) < .05, "environment");
  expect(results[1].occlusion < .001, "nothing is there");
  gather_with_gains(engine, scene, settings, receivers, results[0]);
  gather_as_older_caller(engine, scene, settings, receivers, results[0]);
  expect(surfeit_gather(gatherer, receivers, 2, results, at_once, NULL) == SURFEIT_INTERRUPTED,
         "interrupted");
  expect(surfeit_gather(NULL, receivers, 2, results, NULL, NULL) == SURFEIT_INVALID_ARGUMENT,
         "no gatherer");

  instances[0].scene = instances[1].scene = scene;
  expect(surfeit_gatherer_create_instances(engine, instances, 2, &settings, NULL, &moved) ==
             SURFEIT_OK,
         "instances");
  expect(surfeit_gather(moved, receivers, 2, results, NULL, NULL) == SURFEIT_OK, "gather");
  expect(fabs(results[1].occlusion - .239) < .01, "occlusion of the instance");
  expect(surfeit_gatherer_clone(moved, &clone) == SURFEIT_OK, "clone");
  expect(surfeit_gather(clone, receivers + 1, 1, &again, NULL, NULL) == SURFEIT_OK, "gather");
  expect(fabs(again.occlusion - results[1].occlusion) < .001, "the clone's result");
  instances[1].m[0] = -1;
  expect(surfeit_gatherer_create_instances(engine, instances, 2, NULL, NULL, &moved) ==
             SURFEIT_INVALID_ARGUMENT,
         "a mirror");

  surfeit_gatherer_pause(clone);
  surfeit_gatherer_release(clone);
  surfeit_gatherer_release(moved);
  surfeit_gatherer_release(gatherer);
}

int main(int argc, char** argv) {
  char path[4096], odd[4096];
  surfeit_engine_options options;
  surfeit_engine* engine = NULL;
  surfeit_scene *scene = NULL, *held = NULL;
  surfeit_scene_info info;
  surfeit_statistics statistics;
  size_t size = 0;
  void* bytes;
  if (argc != 2) return 2;
  snprintf(path, sizeof path, "%s/c.sft", argv[1]);
  expect(strcmp(surfeit_last_error(), "") == 0, "an error before anything was done");
  expect(strchr(surfeit_version(), '.') != NULL, "version");
  make_scene(path);
  snprintf(odd, sizeof odd, "%s/odd.sft", argv[1]);
  index_odd_surfels(odd);

  surfeit_engine_options_init(&options);
  options.memory_bytes = 64 << 20;
  options.threads = 2;
  options.lobes = 1;
  expect(surfeit_engine_create(&options, &engine) == SURFEIT_OK, "engine");
  options.memory_bytes = 1;
  expect(surfeit_engine_create(&options, &engine) == SURFEIT_BUDGET_TOO_SMALL, "a byte");
  options.size = 1;
  expect(surfeit_engine_create(&options, &engine) == SURFEIT_INVALID_ARGUMENT, "a wrong size");

  expect(surfeit_scene_open(engine, "/nowhere.sft", &scene) == SURFEIT_IO_ERROR, "no file");
  expect(surfeit_scene_open(engine, path, &scene) == SURFEIT_OK, "open");
  memset(&info, 0, sizeof info);
  expect(surfeit_scene_get_info(scene, &info) == SURFEIT_INVALID_ARGUMENT, "no size");
  info.size = offsetof(surfeit_scene_info, surfels);
  expect(surfeit_scene_get_info(scene, &info) == SURFEIT_OK && info.file_bytes > 0 &&
             info.surfels == 0,
         "info of an older caller");
  info.size = sizeof info;
  expect(surfeit_scene_get_info(scene, &info) == SURFEIT_OK && info.surfels == EDGE * EDGE, "info");

  expect(surfeit_scene_open(engine, odd, &held) == SURFEIT_OK &&
             surfeit_scene_get_info(held, &info) == SURFEIT_OK && info.surfels == 4,
         "surfels with some sizes");
  surfeit_scene_release(held);

  bytes = read_all(path, &size);
  expect(surfeit_scene_open_bytes(engine, bytes, size, "held", &held) == SURFEIT_OK, "bytes");
  expect(surfeit_scene_open_bytes(engine, bytes, size / 2, "held", &held) == SURFEIT_CORRUPTION,
         "half of it");
  free(bytes);

  gather_from(engine, scene);
  gather_from(engine, held);

  statistics.size = sizeof statistics;
  expect(surfeit_engine_statistics(engine, &statistics) == SURFEIT_OK && statistics.scenes == 2 &&
             statistics.gatherers == 0 && statistics.receivers == 2 * 7,
         "statistics");
  surfeit_scene_release(held);
  surfeit_scene_release(scene);
  surfeit_engine_release(engine);
  surfeit_engine_release(NULL);
  surfeit_scene_release(NULL);
  surfeit_gatherer_release(NULL);
  if (failures == 0) puts("all functions of surfeit.h");
  return failures == 0 ? 0 : 1;
}
