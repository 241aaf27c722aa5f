// Rates of reading clouds of every format, beside reading the same bytes into a buffer (`cat` to
// /dev/null), and the memory that it takes: wall time, the best of several passes over a file that
// lies in the page cache; every file is written, and read, by a process of its own, whose peak
// resident memory is told. The cloud is random: position, normal, radius, area and radiosity, 44
// bytes a point; of LAS and PCD, which are not written, positions alone; of OpenEXR a pass with the
// same, a pixel for each.
//
//   convert_bench DIRECTORY [POINTS [EXTENSION...]]     default: 2000000, all formats

#include <OpenEXR/ImfHeader.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/exr/exr_image_writer.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

constexpr int kPasses = 3;
constexpr std::size_t kBatchRows = 8192;
constexpr std::uint64_t kWriterMemory = std::uint64_t{64} << 30;  // OpenVDB holds what it writes
constexpr const char* kProperties[] = {
    "x", "y", "z", "nx", "ny", "nz", "radius", "area", "radiosity_r", "radiosity_g", "radiosity_b"};

// The same numbers everywhere, fast.
class Random {
 public:
  // From 0 to below 1.
  float next() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<float>(state_ >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_ = 1;
};

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Status writeRows(const std::string& path, std::uint64_t points) {
  RowWriterOptions options;
  for (const char* name : kProperties) {
    RowProperty property;
    property.name = name;
    options.properties.push_back(property);
  }
  options.count = points;
  options.memory_bytes = kWriterMemory;
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer, createRowWriter(path, options));
  Random random;
  std::vector<std::array<float, std::size(kProperties)>> rows;
  for (std::uint64_t done = 0; done < points; done += rows.size()) {
    rows.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kBatchRows, points - done)));
    for (auto& row : rows) {
      for (float& value : row) value = random.next();
      for (int axis = 0; axis < 3; ++axis) row[std::size_t(axis)] *= 1000;
    }
    SURFEIT_RETURN_IF_ERROR(writer->writeRows(std::as_bytes(std::span(rows))));
  }
  return writer->finish();
}

// Records of a fixed size that begin with three values, behind a header.
template <typename Value>
Status writeRecords(const std::string& path, std::span<const std::byte> header,
                    std::size_t record_bytes, std::uint64_t points) {
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput file, ByteOutput::create(path));
  SURFEIT_RETURN_IF_ERROR(file.append(header));
  Random random;
  std::vector<std::byte> rows;
  for (std::uint64_t done = 0; done < points; done += kBatchRows) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kBatchRows, points - done));
    rows.assign(count * record_bytes, std::byte{0});
    for (std::size_t i = 0; i < count; ++i) {
      Value position[3];
      for (Value& value : position) value = static_cast<Value>(1e6f * random.next());
      std::memcpy(&rows[i * record_bytes], position, sizeof position);
    }
    SURFEIT_RETURN_IF_ERROR(file.append(rows));
  }
  return file.commit();
}

// LAS 1.2, point format 0, of integers in millimetres.
Status writeLas(const std::string& path, std::uint64_t points) {
  std::array<std::byte, 227> header{};
  const auto put = [&header](std::size_t offset, auto value) {
    std::memcpy(&header[offset], &value, sizeof value);
  };
  std::memcpy(header.data(), "LASF", 4);
  put(24, std::uint8_t{1});
  put(25, std::uint8_t{2});
  put(94, static_cast<std::uint16_t>(header.size()));
  put(96, static_cast<std::uint32_t>(header.size()));
  put(105, std::uint16_t{20});
  put(107, static_cast<std::uint32_t>(points));
  for (std::size_t axis = 0; axis < 3; ++axis) put(131 + 8 * axis, 0.001);
  return writeRecords<std::int32_t>(path, header, 20, points);
}

Status writePcd(const std::string& path, std::uint64_t points) {
  const std::string header = fmt::format(
      "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {}\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA binary\n",
      points, points);
  return writeRecords<float>(path, std::as_bytes(std::span(header)), 12, points);
}

// A pass 8,000 pixels wide. What is left of the last line is masked.
Status writeExr(const std::string& path, std::uint64_t points) {
  constexpr std::uint64_t kWidth = 8000;
  const auto height = static_cast<int>((points + kWidth - 1) / kWidth);
  std::vector<ExrImageChannel> channels;
  for (const char* name : {"P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "radius", "area",
                           "radiosity.R", "radiosity.G", "radiosity.B", "A"}) {
    channels.push_back({.name = name});
  }
  const std::size_t mask = channels.size() - 1;
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<ExrImageWriter> image,
      ExrImageWriter::create(path, Imf::Header(kWidth, height), std::move(channels)));
  Random random;
  for (std::uint64_t first = 0; first < points; first += kWidth) {
    for (std::size_t x = 0; x < kWidth; ++x) {
      for (std::size_t i = 0; i < mask; ++i) {
        image->floats(i)[x] = (i < 3 ? 1000 : 1) * random.next();
      }
      image->floats(mask)[x] = first + x < points ? 1 : 0;
    }
    SURFEIT_RETURN_IF_ERROR(image->writeLine());
  }
  return image->finish();
}

Status writeCloud(const std::string& path, std::uint64_t points) {
  if (path.ends_with(".las")) return writeLas(path, points);
  if (path.ends_with(".pcd")) return writePcd(path, points);
  if (path.ends_with(".exr")) return writeExr(path, points);
  return writeRows(path, points);
}

// Opens and reads to the end.
Status readCloud(const std::string& path, std::uint64_t points) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openRowReader(path));
  AlignedBuffer buffer;
  std::uint64_t rows = 0;
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, reader->readRows(kBatchRows, buffer));
    if (bytes.empty()) break;
    rows += bytes.size() / reader->element().row_bytes;
  }
  if (rows == points) return {};
  return Status::failed(fmt::format("{}: found {} rows, expected {}", path, rows, points));
}

Status readBytes(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return Status::ioError(path + ": cannot open");
  std::vector<std::byte> buffer(128 << 10);  // as cat
  ssize_t got = 0;
  while ((got = ::read(file, buffer.data(), buffer.size())) > 0) {
  }
  ::close(file);
  return got == 0 ? Status() : Status::ioError(path + ": cannot read");
}

struct Measured {
  double seconds = 0;
  double peak_mib = 0;
};

// Runs `work` several times in a process of its own.
Result<Measured> measure(int passes, const std::function<Status()>& work) {
  int ends[2];
  if (::pipe(ends) != 0) return Status::failed("no pipe");
  const pid_t child = ::fork();
  if (child < 0) return Status::failed("no process");
  if (child == 0) {
    double best = std::numeric_limits<double>::infinity();
    for (int pass = 0; pass < passes; ++pass) {
      const double begin = seconds();
      const Status status = work();
      if (!status.ok()) {
        fmt::print(stderr, "convert_bench: {}\n", status.message());
        ::_exit(1);
      }
      best = std::min(best, seconds() - begin);
    }
    ::_exit(::write(ends[1], &best, sizeof best) == sizeof best ? 0 : 1);
  }
  ::close(ends[1]);
  Measured measured;
  const bool is_told =
      ::read(ends[0], &measured.seconds, sizeof measured.seconds) == sizeof measured.seconds;
  ::close(ends[0]);
  rusage usage{};
  int status = 0;
  ::wait4(child, &status, 0, &usage);
  if (!is_told || status != 0) return Status::failed("a pass failed");
  measured.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024;
  return measured;
}

Status measureFormat(const std::string& path, const std::string& extension, std::uint64_t points) {
  SURFEIT_ASSIGN_OR_RETURN(const Measured written,
                           measure(1, [&] { return writeCloud(path, points); }));
  SURFEIT_ASSIGN_OR_RETURN(const Measured cat, measure(kPasses, [&] { return readBytes(path); }));
  SURFEIT_ASSIGN_OR_RETURN(const Measured read,
                           measure(kPasses, [&] { return readCloud(path, points); }));
  const double megabytes = 1e-6 * static_cast<double>(std::filesystem::file_size(path));
  fmt::print("{:<10} {:8.1f} {:9.0f} {:9.0f} {:6.2f} {:9.2f} {:9.1f} {:11.0f} {:11.1f}\n",
             extension, megabytes, megabytes / read.seconds, megabytes / cat.seconds,
             cat.seconds / read.seconds, 1e-6 * static_cast<double>(points) / read.seconds,
             read.peak_mib, megabytes / written.seconds, written.peak_mib);
  std::fflush(stdout);
  return {};
}

// The first extension of every format; PLY compressed, too.
std::vector<std::string> allExtensions() {
  std::vector<std::string> extensions = {".ply.gz", ".ply.zst", ".las", ".pcd"};
  for (const CloudFormat& format : cloudFormats()) {
    if (format.create == nullptr) continue;
    extensions.emplace_back(format.extensions.substr(0, format.extensions.find(' ')));
  }
  std::sort(extensions.begin(), extensions.end());
  return extensions;
}

Status run(const std::string& directory, std::uint64_t points,
           const std::vector<std::string>& extensions) {
  fmt::print("{} points\n{:<10} {:>8} {:>9} {:>9} {:>6} {:>9} {:>9} {:>11} {:>11}\n", points,
             "format", "file MB", "read MB/s", "cat MB/s", "ratio", "M rows/s", "peak MiB",
             "write MB/s", "write MiB");
  for (const std::string& extension : extensions) {
    const std::string path = directory + "/convert_bench" + extension;
    const Status status = measureFormat(path, extension, points);
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    SURFEIT_RETURN_IF_ERROR(status);
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  const std::uint64_t points = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 2000000;
  if (argc < 2 || points == 0) {
    fmt::print(stderr, "convert_bench: expected DIRECTORY [POINTS [EXTENSION...]]\n");
    return 2;
  }
  std::vector<std::string> extensions(argv + std::min(argc, 3), argv + argc);
  if (extensions.empty()) extensions = surfeit::allExtensions();
  const surfeit::Status status = surfeit::run(argv[1], points, extensions);
  if (!status.ok()) fmt::print(stderr, "convert_bench: {}\n", status.message());
  return status.ok() ? 0 : 1;
}
