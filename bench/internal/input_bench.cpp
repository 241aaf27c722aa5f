// CPU time per surfel on the way into the indexer: write, fetch and decode a cloud, find curve
// keys. Best of several passes over a random cloud with all channels (57 bytes a record):
//
//   input_bench [DIRECTORY [SURFELS]]     default: the system's temporary directory, 1000000

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "cloud/ply/ply_reader.h"
#include "core/curve_key.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_mapping.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr int kPasses = 5;
constexpr CloudChannels kAllChannels = {true, true, true, true, true, true};
constexpr std::size_t kBatch = 4096;  // surfels that stay in the second-level cache

double cpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

// Prints the best of several passes; `work` returns a Status.
template <typename Work>
Status measure(const char* name, std::size_t surfels, Work work) {
  double best = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < kPasses; ++pass) {
    const double begin = cpuSeconds();
    SURFEIT_RETURN_IF_ERROR(work());
    best = std::min(best, cpuSeconds() - begin);
  }
  fmt::print("{:<44} {:8.2f} ns/surfel {:8.1f} M surfels/s\n", name, 1e9 * best / double(surfels),
             1e-6 * double(surfels) / best);
  return {};
}

std::vector<Surfel> randomCloud(std::size_t count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0.001f, 1);
  std::vector<Surfel> cloud(count);
  for (Surfel& surfel : cloud) {
    for (int axis = 0; axis < 3; ++axis) {
      surfel.position[axis] = 1000 * uniform(random);
      surfel.normal[axis] = uniform(random) - 0.5f;
      surfel.radiosity[axis] = uniform(random);
      surfel.albedo[axis] = uniform(random);
    }
    surfel.radius = uniform(random);
    surfel.area = uniform(random);
  }
  return cloud;
}

Status writeCloud(const std::string& path, std::span<const Surfel> cloud, PlyEncoding encoding) {
  SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer,
                           SurfelWriter::create(path, kAllChannels, {.ply_encoding = encoding}));
  SURFEIT_RETURN_IF_ERROR(writer.write(cloud));
  return writer.finish();
}

// A file of one encoding: written, its records fetched (past the page cache), its surfels read.
Status measureFile(const std::string& path, std::span<const Surfel> cloud, PlyEncoding encoding,
                   const std::string& name) {
  const std::size_t count = cloud.size();
  SURFEIT_RETURN_IF_ERROR(measure(("write " + name + ", sync included").c_str(), count,
                                  [&] { return writeCloud(path, cloud, encoding); }));
  RowReaderOptions options;
  options.access = Access::kDirect;
  SURFEIT_ASSIGN_OR_RETURN(const auto source, openSurfelSource(path, false, options));
  AlignedBuffer buffer;
  const auto fetch = [&]() -> Status {
    SURFEIT_RETURN_IF_ERROR(source->rewind());
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, source->readRows(65536, buffer));
      if (rows.empty()) return {};
    }
  };
  SURFEIT_RETURN_IF_ERROR(measure(("fetch " + name).c_str(), count, fetch));
  std::vector<Surfel> surfels(kBatch);
  const auto read = [&]() -> Status {
    SURFEIT_RETURN_IF_ERROR(source->rewind());
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, source->read(surfels));
      if (size == 0) return {};
    }
  };
  return measure(("fetch and decode " + name).c_str(), count, read);
}

// Records that lie in the cache.
Status measureDecoding(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path));
  const RowLayout& element = reader.header().elements[0];
  SURFEIT_ASSIGN_OR_RETURN(const SurfelMapping mapping, SurfelMapping::create(element, path));
  AlignedBuffer buffer;
  SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader.readRowView(kBatch, buffer));
  const std::size_t count = rows.size() / element.row_bytes;
  const std::size_t repeats = 1 + 1000000 / count;

  std::vector<Surfel> surfels(count);
  SurfelDefects defects;
  const auto decodeFast = [&]() -> Status {
    for (std::size_t i = 0; i < repeats; ++i) mapping.decodeRows(rows, 0, surfels, defects);
    return {};
  };
  SURFEIT_RETURN_IF_ERROR(measure("decode rows of floats", repeats * count, decodeFast));
  const auto decodeGeneral = [&]() -> Status {
    for (std::size_t i = 0; i < repeats * count; ++i) {
      const std::size_t row = i % count;
      mapping.decode(&rows[row * element.row_bytes], row, surfels[row], defects);
    }
    return {};
  };
  return measure("decode any rows, one by one", repeats * count, decodeGeneral);
}

Status measureKeys(std::span<const Surfel> cloud) {
  const RootCube cube{{0, 0, 0}, 1001};
  cloud = cloud.first(std::min(kBatch, cloud.size()));
  const std::size_t repeats = 1 + 1000000 / cloud.size();
  const std::size_t count = repeats * cloud.size();
  std::vector<CurveKey> keys(cloud.size());
  SURFEIT_RETURN_IF_ERROR(measure("curve keys, batch", count, [&]() -> Status {
    for (std::size_t i = 0; i < repeats; ++i) {
      curveKeys(&cloud[0].position, sizeof(Surfel), cube, keys);
    }
    return {};
  }));
  SURFEIT_RETURN_IF_ERROR(measure("curve keys, one by one", count, [&]() -> Status {
    for (std::size_t i = 0; i < count; ++i) {
      keys[i % keys.size()] = curveKey(cloud[i % keys.size()].position, cube);
    }
    return {};
  }));
  return measure("curve keys, definition", count, [&]() -> Status {
    for (std::size_t i = 0; i < count; ++i) {
      const glm::vec3 cell = cloud[i % keys.size()].position * 2000.f;
      keys[i % keys.size()] =
          curveKey(std::uint32_t(cell.x), std::uint32_t(cell.y), std::uint32_t(cell.z));
    }
    return {};
  });
}

Status run(const std::string& directory, std::size_t surfels) {
  const std::vector<Surfel> cloud = randomCloud(surfels);
  SURFEIT_RETURN_IF_ERROR(measureKeys(cloud));
  const std::string path = directory + "/input_bench.ply";
  SURFEIT_RETURN_IF_ERROR(measureFile(path, cloud, PlyEncoding::kAscii, "ascii"));
  SURFEIT_RETURN_IF_ERROR(measureFile(path, cloud, PlyEncoding::kBinaryBigEndian, "big-endian"));
  SURFEIT_RETURN_IF_ERROR(
      measureFile(path, cloud, PlyEncoding::kBinaryLittleEndian, "little-endian"));
  SURFEIT_RETURN_IF_ERROR(measureDecoding(path));
  std::filesystem::remove(path);
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  const std::string directory =
      argc > 1 ? argv[1] : std::filesystem::temp_directory_path().string();
  const std::size_t surfels = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1000000;
  if (surfels == 0) {
    fmt::print(stderr, "input_bench: found 0 surfels, expected 1 or more\n");
    return 2;
  }
  const surfeit::Status status = surfeit::run(directory, surfels);
  if (!status.ok()) fmt::print(stderr, "input_bench: {}\n", status.message());
  return status.ok() ? 0 : 1;
}
