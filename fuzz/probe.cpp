#include "fuzz/probe.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/exr/exr_reader.h"
#include "cloud/houdini/bgeo_ascii_reader.h"
#include "cloud/houdini/bgeo_json_reader.h"
#include "cloud/houdini/bgeo_reader.h"
#include "cloud/particles/pdb_reader.h"
#include "cloud/particles/prt2_reader.h"
#include "cloud/particles/prt_reader.h"
#include "cloud/particles/ptc_reader.h"
#include "cloud/pictures/picture_reader.h"
#include "cloud/ply/ply_rows.h"
#include "cloud/scans/las_reader.h"
#include "cloud/scans/pcd_reader.h"
#include "cloud/scans/ptx_reader.h"
#include "cloud/text/xyz_reader.h"
#include "cloud/vdb/vdb_reader.h"
#include "core/assert.h"
#include "fuzz/row_probe.h"
#include "fuzz/scene_probe.h"
#include "storage/byte_input.h"

namespace surfeit {
namespace {

// A few KiB of a compressed file may stand for gigabytes; this much of it is decoded, and as much
// of a picture
constexpr std::size_t kMaxDecodedBytes = 8 << 20;

template <auto open>
void readCloud(const std::string& path) {
  probeRows(path, open);
}

// Any format, as a user's file is opened: by its first bytes, decompressed or not.
void readAnyCloud(const std::string& path) { probeRows(path, openRowReader); }

// gzip, zstd or neither: all bytes once, then some from before.
void readCompressed(const std::string& path) {
  Result<ByteInput> input = ByteInput::open(path);
  if (!input.ok()) return;
  std::vector<std::byte> bytes(100000), again(100);
  std::array<std::byte, 100> first = {};
  std::uint64_t offset = 0;
  while (offset < kMaxDecodedBytes) {
    const Result<std::size_t> size = input->readSome(offset, bytes);
    if (!size.ok()) return checkRefusal(size.status());
    SURFEIT_CHECK(*size <= bytes.size());
    if (offset == 0) std::copy_n(bytes.begin(), std::min(*size, first.size()), first.begin());
    offset += *size;
    if (*size < bytes.size()) break;
  }
  const std::size_t size = static_cast<std::size_t>(std::min<std::uint64_t>(offset, first.size()));
  SURFEIT_CHECK(input->readAt(0, std::span(again).first(size)).ok());
  SURFEIT_CHECK(std::memcmp(again.data(), first.data(), size) == 0);
}

// A picture of light.
void readPicture(const std::string& path) {
  Result<std::unique_ptr<PictureReader>> picture = PictureReader::open(path);
  if (!picture.ok()) return checkRefusal(picture.status());
  PictureReader& reader = **picture;
  SURFEIT_CHECK(reader.width() > 0 && reader.height() > 0);
  std::vector<glm::vec3> row(static_cast<std::size_t>(reader.width()));
  std::size_t decoded = 0;
  for (int y = 0; y < reader.height() && decoded < kMaxDecodedBytes; ++y) {
    const Status status = reader.readRow(row);
    if (!status.ok()) return checkRefusal(status);
    decoded += row.size() * sizeof(glm::vec3);
  }
}

constexpr Probe kProbes[] = {
    {"any", readAnyCloud},
    {"compressed", readCompressed},
    {"ply", readCloud<openPlyRows>},
    {"ptc", readCloud<openPtc>},
    {"las", readCloud<openLas>},
    {"pcd", readCloud<openPcd>},
    {"xyz", readCloud<openXyz>},
    {"ptx", readCloud<openPtx>},
    {"vdb", readCloud<openVdb>},
    {"prt", readCloud<openPrt>},
    {"prt2", readCloud<openPrt2>},
    {"bgeo", readCloud<openBgeo>},
    {"bgeo_json", readCloud<openBgeoJson>},
    {"geo", readCloud<openBgeoAscii>},
    {"pdb", readCloud<openPdb>},
    {"exr", readCloud<openExr>},
    {"picture", readPicture},
    {"scene", probeScene},
    {"surfel_page", probeSurfelPage},
    {"node_page", probeNodePage},
    {"recipe", probeRecipe},
    {"expression", probeExpression},
};

}  // namespace

std::span<const Probe> probes() { return kProbes; }

const Probe* findProbe(std::string_view name) {
  const auto* found = std::find_if(std::begin(kProbes), std::end(kProbes),
                                   [&](const Probe& probe) { return probe.name == name; });
  return found == std::end(kProbes) ? nullptr : found;
}

void probeBytes(const Probe& probe, std::span<const std::byte> bytes) {
  const int descriptor = memfd_create("probe", MFD_CLOEXEC);
  SURFEIT_CHECK(descriptor >= 0);
  SURFEIT_CHECK(write(descriptor, bytes.data(), bytes.size()) ==
                static_cast<ssize_t>(bytes.size()));
  probe.read(fmt::format("/proc/self/fd/{}", descriptor));
  close(descriptor);
}

}  // namespace surfeit
