// A small renderer on Surfeit's engine: camera rays and direct light through Embree, occlusion and
// color bleeding from one engine that all threads share, tile by tile.
//
//   renderer MESH.obj --output PREFIX [--size 480] [--memory 64] [--threads N] [--eye X,Y,Z]
//
// writes PREFIX_occlusion.png and PREFIX_color.png. It uses the public headers alone.
#include <embree3/rtcore.h>
#include <png.h>
#include <surfeit/engine.h>
#include <surfeit/surfel_source.h>
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <iostream>
#include <limits>
#include <string>
#include <thread>
#include <vector>

namespace {

struct Arguments {
  std::string mesh, output;
  int size = 480, threads = 0;
  std::uint64_t memory_mib = 64;
  bool has_eye = false;
  glm::vec3 eye{0};
};

struct Triangle {
  glm::vec3 corner[3], normal[3];
  glm::vec3 albedo{0.7f}, emission{0};  // reflectance; radiant exitance
  glm::vec3 face() const { return glm::cross(corner[1] - corner[0], corner[2] - corner[0]); }
  float area() const { return 0.5f * glm::length(face()); }
  glm::vec3 at(float u, float v) const {
    return (1 - u - v) * corner[0] + u * corner[1] + v * corner[2];
  }
};

struct Hit {
  glm::vec3 position, normal;
  const Triangle* triangle;
};

// Numbers between 0 and 1 that look random.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u + 1) {}
  float next() {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    return float(state_ >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_;
};

[[noreturn]] void fail(const std::string& message) {
  std::cerr << "renderer: " << message << '\n';
  std::exit(1);
}

void check(const surfeit::Status& status) {
  if (!status.ok()) fail(status.message());
}

template <typename T>
T valueOf(surfeit::Result<T> result) {
  check(result.status());
  return std::move(*result);
}

std::vector<Triangle> readMesh(const std::string& path) {
  tinyobj::ObjReaderConfig config;
  config.triangulate = true;
  tinyobj::ObjReader reader;
  if (!reader.ParseFromFile(path, config)) fail(path + ": " + reader.Error());
  const tinyobj::attrib_t& values = reader.GetAttrib();
  const auto vectorAt = [](const std::vector<float>& from, int index) {
    const float* const v = &from[std::size_t(index) * 3];
    return glm::vec3(v[0], v[1], v[2]);
  };
  std::vector<Triangle> triangles;
  for (const tinyobj::shape_t& shape : reader.GetShapes()) {
    for (std::size_t i = 0; i + 2 < shape.mesh.indices.size(); i += 3) {
      Triangle triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        const tinyobj::index_t& index = shape.mesh.indices[i + k];
        triangle.corner[k] = vectorAt(values.vertices, index.vertex_index);
        triangle.normal[k] =
            index.normal_index >= 0 ? vectorAt(values.normals, index.normal_index) : glm::vec3(0);
      }
      const int material = shape.mesh.material_ids[i / 3];
      if (material >= 0) {
        const tinyobj::material_t& of = reader.GetMaterials()[std::size_t(material)];
        triangle.albedo = {of.diffuse[0], of.diffuse[1], of.diffuse[2]};
        triangle.emission = 3.14159265f * glm::vec3(of.emission[0], of.emission[1], of.emission[2]);
      }
      if (triangle.area() > 0) triangles.push_back(triangle);
    }
  }
  if (triangles.empty()) fail(path + ": no triangles");
  return triangles;
}

// The mesh for rays, and its light.
class World {
 public:
  explicit World(std::vector<Triangle> triangles)
      : triangles_(std::move(triangles)),
        device_(rtcNewDevice(nullptr)),
        scene_(rtcNewScene(device_)) {
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* const vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), 3 * triangles_.size()));
    auto* const indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), triangles_.size()));
    for (std::size_t i = 0; i < 3 * triangles_.size(); ++i) {
      const glm::vec3& corner = triangles_[i / 3].corner[i % 3];
      for (int axis = 0; axis < 3; ++axis) vertices[3 * i + std::size_t(axis)] = corner[axis];
      indices[i] = unsigned(i);
      min_ = glm::min(min_, corner);
      max_ = glm::max(max_, corner);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
    for (const Triangle& triangle : triangles_) {
      const float power = triangle.area() *
                          std::max({triangle.emission.x, triangle.emission.y, triangle.emission.z});
      if (power > 0) emitters_.push_back(&triangle);
    }
  }
  ~World() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  const std::vector<Triangle>& triangles() const { return triangles_; }
  glm::vec3 centre() const { return 0.5f * (min_ + max_); }
  float extent() const { return glm::length(max_ - min_); }

  bool trace(const glm::vec3& from, const glm::vec3& direction, Hit& hit) const {
    RTCRayHit ray = rayOf(from, direction, std::numeric_limits<float>::infinity());
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    const Triangle& triangle = triangles_[ray.hit.primID];
    const float u = ray.hit.u, v = ray.hit.v;
    hit.position = triangle.at(u, v);
    hit.normal = (1 - u - v) * triangle.normal[0] + u * triangle.normal[1] + v * triangle.normal[2];
    if (!(glm::length(hit.normal) > 0)) hit.normal = triangle.face();
    hit.normal = glm::normalize(hit.normal);
    hit.triangle = &triangle;
    return true;
  }

  // Irradiance from emitters, by `samples` rays to each.
  glm::vec3 directLight(const glm::vec3& place, const glm::vec3& normal, int samples,
                        Random& random) const {
    glm::vec3 sum(0);
    for (const Triangle* emitter : emitters_) {
      const glm::vec3 facing = glm::normalize(emitter->face());
      for (int i = 0; i < samples; ++i) {
        const float root = std::sqrt(random.next()), v = random.next() * root;
        const glm::vec3 to_light = emitter->at(1 - root, v) - place;
        const float distance = glm::length(to_light);
        const float cosines = glm::dot(normal, to_light) * -glm::dot(facing, to_light);
        if (!(glm::dot(normal, to_light) > 0 && cosines > 0)) continue;
        const glm::vec3 start = place + 1e-4f * extent() * normal;
        if (isBlocked(start, to_light / distance, distance * 0.999f)) continue;
        const float form = cosines / (distance * distance * distance * distance);
        sum += emitter->emission * (form * emitter->area() / 3.14159265f / float(samples));
      }
    }
    return sum;
  }

 private:
  static RTCRayHit rayOf(const glm::vec3& from, const glm::vec3& direction, float length) {
    RTCRayHit ray = {};
    ray.ray.org_x = from.x;
    ray.ray.org_y = from.y;
    ray.ray.org_z = from.z;
    ray.ray.dir_x = direction.x;
    ray.ray.dir_y = direction.y;
    ray.ray.dir_z = direction.z;
    ray.ray.tfar = length;
    ray.ray.mask = ~0u;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    return ray;
  }
  bool isBlocked(const glm::vec3& from, const glm::vec3& direction, float length) const {
    RTCRayHit ray = rayOf(from, direction, length);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene_, &context, &ray.ray);
    return ray.ray.tfar < 0;
  }

  const std::vector<Triangle> triangles_;
  RTCDevice device_;
  RTCScene scene_;
  glm::vec3 min_{std::numeric_limits<float>::max()}, max_{-std::numeric_limits<float>::max()};
  std::vector<const Triangle*> emitters_;
};

// Divides every triangle into n x n small ones of about `edge`, and lights a surfel of each.
std::vector<surfeit::Surfel> makeSurfels(const World& world, float edge) {
  std::vector<surfeit::Surfel> surfels;
  Random random(1);
  for (const Triangle& triangle : world.triangles()) {
    const glm::vec3 a = triangle.corner[1] - triangle.corner[0];
    const glm::vec3 b = triangle.corner[2] - triangle.corner[0];
    const float longest = std::max({glm::length(a), glm::length(b), glm::length(a - b)});
    const int n = std::max(1, int(std::ceil(longest / edge)));
    for (int row = 0; row < n; ++row) {
      for (int column = 0; column < 2 * (n - row) - 1; ++column) {
        // Upright triangles, and those that stand on their heads between them
        const float third = column % 2 == 0 ? 1.f / 3 : 2.f / 3;
        const float u = (float(column / 2) + third) / float(n), v = (float(row) + third) / float(n);
        surfeit::Surfel surfel;
        surfel.position = triangle.at(u, v);
        surfel.normal = glm::normalize(triangle.face());
        surfel.area = triangle.area() / float(n * n);
        surfel.radius =
            std::max({glm::length(a + b), glm::length(a - 2.f * b), glm::length(b - 2.f * a)}) /
            (3 * float(n));
        surfel.albedo = triangle.albedo;
        // What emitters send directly, rays find better
        surfel.radiosity =
            triangle.albedo * world.directLight(surfel.position, surfel.normal, 4, random);
        surfels.push_back(surfel);
      }
    }
  }
  return surfels;
}

struct Picture {
  explicit Picture(int edge) : size(edge), pixels(std::size_t(edge) * std::size_t(edge)) {}
  int size;
  std::vector<glm::vec3> pixels;

  void write(const std::string& path) const {
    std::vector<std::uint8_t> bytes;
    for (const glm::vec3& pixel : pixels) {
      for (int channel = 0; channel < 3; ++channel) {
        const float value = std::clamp(pixel[channel], 0.f, 1.f);
        bytes.push_back(std::uint8_t(255 * std::pow(value, 1 / 2.2f) + 0.5f));
      }
    }
    png_image image = {};
    image.version = PNG_IMAGE_VERSION;
    image.width = image.height = png_uint_32(size);
    image.format = PNG_FORMAT_RGB;
    if (png_image_write_to_file(&image, path.c_str(), 0, bytes.data(), 0, nullptr) == 0) {
      fail(path + ": " + image.message);
    }
  }
};

// One thread's renderer: rays of its own, and a gatherer of its own.
class TileRenderer {
 public:
  static constexpr int kTile = 16;

  TileRenderer(const World& world, surfeit::Gatherer gatherer, const Arguments& arguments)
      : world_(world), gatherer_(std::move(gatherer)), arguments_(arguments) {
    const glm::vec3 target = world.centre();
    eye_ = arguments.has_eye ? arguments.eye : target + glm::vec3(0, 0, 1.1f * world.extent());
    forward_ = glm::normalize(target - eye_);
    right_ = glm::normalize(glm::cross(forward_, glm::vec3(0, 1, 0)));
    up_ = glm::cross(right_, forward_);
  }

  // Rays of a tile first; then what they hit is gathered at in one call.
  void render(int tile_x, int tile_y, Picture& occlusion, Picture& color) {
    receivers_.clear();
    hits_.clear();
    places_.clear();
    for (int i = 0; i < kTile * kTile; ++i) {
      const int x = tile_x * kTile + i % kTile, y = tile_y * kTile + i / kTile;
      if (x >= arguments_.size || y >= arguments_.size) continue;
      const float slope = 0.45f;
      const float u = (2 * (float(x) + 0.5f) / float(arguments_.size) - 1) * slope;
      const float v = (1 - 2 * (float(y) + 0.5f) / float(arguments_.size)) * slope;
      const glm::vec3 direction = glm::normalize(forward_ + u * right_ + v * up_);
      Hit hit;
      if (!world_.trace(eye_, direction, hit)) continue;
      if (glm::dot(hit.normal, direction) > 0) hit.normal = -hit.normal;
      receivers_.push_back({glm::dvec3(hit.position), hit.normal, glm::vec3(0)});
      hits_.push_back(hit);
      places_.push_back(std::size_t(y) * std::size_t(arguments_.size) + std::size_t(x));
    }
    results_.resize(receivers_.size());
    check(gatherer_.gather(receivers_.data(), receivers_.size(), results_.data()));

    Random random(std::uint64_t(tile_y) << 20 | std::uint64_t(tile_x));
    for (std::size_t i = 0; i < hits_.size(); ++i) {
      const Hit& hit = hits_[i];
      occlusion.pixels[places_[i]] = glm::vec3(1 - results_[i].occlusion);
      const glm::vec3 direct = world_.directLight(hit.position, hit.normal, 8, random);
      color.pixels[places_[i]] =
          (hit.triangle->emission + hit.triangle->albedo * (direct + results_[i].irradiance)) /
          3.14159265f;
    }
  }

 private:
  const World& world_;
  surfeit::Gatherer gatherer_;
  const Arguments& arguments_;
  glm::vec3 eye_{0}, forward_{0}, right_{0}, up_{0};
  std::vector<surfeit::Receiver> receivers_;
  std::vector<surfeit::GatherResult> results_;
  std::vector<Hit> hits_;
  std::vector<std::size_t> places_;
};

void renderAll(const World& world, surfeit::Engine& engine, const surfeit::Scene& scene,
               const Arguments& arguments) {
  surfeit::GatherSettings settings;
  settings.mode = surfeit::GatherMode::kBleeding;
  surfeit::Gatherer first = valueOf(engine.gatherer(scene, settings));
  Picture occlusion(arguments.size), color(arguments.size);
  const int tiles = (arguments.size + TileRenderer::kTile - 1) / TileRenderer::kTile;
  std::atomic<int> next{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < arguments.threads; ++i) {
    threads.emplace_back([&, gatherer = valueOf(first.another())]() mutable {
      TileRenderer renderer(world, std::move(gatherer), arguments);
      for (int tile = next++; tile < tiles * tiles; tile = next++) {
        renderer.render(tile % tiles, tile / tiles, occlusion, color);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  occlusion.write(arguments.output + "_occlusion.png");
  color.write(arguments.output + "_color.png");
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto next = [&]() -> std::string {
      if (i + 1 == argc) fail(word + ": expected a value");
      return argv[++i];
    };
    if (word == "--output") {
      arguments.output = next();
    } else if (word == "--size") {
      arguments.size = std::clamp(std::atoi(next().c_str()), 1, 8192);
    } else if (word == "--threads") {
      arguments.threads = std::clamp(std::atoi(next().c_str()), 1, 1024);
    } else if (word == "--memory") {
      arguments.memory_mib = std::uint64_t(std::atoll(next().c_str()));
    } else if (word == "--eye") {
      arguments.has_eye = std::sscanf(next().c_str(), "%f,%f,%f", &arguments.eye.x,
                                      &arguments.eye.y, &arguments.eye.z) == 3;
      if (!arguments.has_eye) fail("--eye: expected X,Y,Z");
    } else if (arguments.mesh.empty() && word[0] != '-') {
      arguments.mesh = word;
    } else {
      fail("unknown argument " + word);
    }
  }
  if (arguments.mesh.empty() || arguments.output.empty()) {
    fail(
        "usage: renderer MESH.obj --output PREFIX [--size 480] [--memory MiB] [--threads N] "
        "[--eye X,Y,Z]");
  }
  if (arguments.threads == 0) {
    arguments.threads = int(std::max(1u, std::thread::hardware_concurrency()));
  }
  return arguments;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments arguments = parse(argc, argv);
  const World world(readMesh(arguments.mesh));
  const std::vector<surfeit::Surfel> surfels = makeSurfels(world, world.extent() / 250);
  surfeit::CloudChannels channels;
  channels.normal = channels.radius = channels.area = channels.radiosity = channels.albedo = true;

  // The scene is a file, of which the engine holds what the budget allows
  const std::string scene_path = arguments.output + ".sft";
  surfeit::SurfelSpan span(surfels.data(), surfels.size(), channels);
  surfeit::Progress quiet;
  surfeit::IndexOptions index_options;
  index_options.memory_bytes = std::max<std::uint64_t>(arguments.memory_mib, 96) << 20;
  valueOf(surfeit::indexSurfels(span, scene_path, index_options, quiet));

  surfeit::EngineOptions engine_options;
  engine_options.memory_bytes = arguments.memory_mib << 20;
  engine_options.threads = arguments.threads;
  surfeit::Engine engine = valueOf(surfeit::Engine::create(engine_options));
  const surfeit::Scene scene = valueOf(engine.open(scene_path));
  const auto begin = std::chrono::steady_clock::now();
  renderAll(world, engine, scene, arguments);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const surfeit::EngineStatistics statistics = engine.statistics();
  std::cout << surfels.size() << " surfels, " << statistics.receivers << " receivers in " << seconds
            << " s on " << arguments.threads << " threads; pages read "
            << statistics.node_cache.misses + statistics.surfel_cache.misses << ", hits "
            << 100 * double(statistics.node_cache.hits + statistics.surfel_cache.hits) /
                   double(statistics.node_cache.requests + statistics.surfel_cache.requests)
            << " %\n"
            << "pictures: " << arguments.output << "_occlusion.png, " << arguments.output
            << "_color.png\n";
  std::filesystem::remove(scene_path);
}
