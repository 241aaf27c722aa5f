// Damaged copies of page files: plain damage, and damage whose checksums are made valid again, so
// that what stands behind the checksums is tested too. Offsets are those of docs/format.md.
#pragma once

#include <xxhash.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "storage/page_file.h"

namespace surfeit {

inline constexpr std::size_t kHeaderChecksumAt = 504;
inline constexpr std::size_t kFooterBytes = 64;
inline constexpr std::size_t kEntryBytes = 24;
// Fields of the footer, from its begin.
enum FooterField : std::size_t {
  kProvenanceOffsetAt = 0,
  kDirectoryOffsetAt = 8,
  kProvenanceChecksumAt = 16,
  kDirectoryChecksumAt = 24,
  kFileBytesAt = 32,
  kNodePagesAt = 40,
  kFooterChecksumAt = 48,
};

template <typename T>
T getAt(const std::string& file, std::size_t offset) {
  T value;
  std::memcpy(&value, file.data() + offset, sizeof value);
  return value;
}

template <typename T>
void setAt(std::string& file, std::size_t offset, T value) {
  std::memcpy(file.data() + offset, &value, sizeof value);
}

inline std::size_t footerAt(const std::string& file) { return file.size() - kFooterBytes; }

inline std::uint64_t hashOf(const std::string& file, std::uint64_t begin, std::uint64_t end,
                            std::uint64_t seed) {
  return XXH3_64bits_withSeed(file.data() + begin, end - begin, seed);
}

// Makes the checksums of header, footer, directory and provenance valid; the last two only when
// the footer's offsets lie in the file. Checksums of pages stay as they are.
inline void sealFile(std::string& file) {
  const std::size_t footer = footerAt(file);
  const std::uint64_t identity = getAt<std::uint64_t>(file, 16);
  const std::uint64_t provenance = getAt<std::uint64_t>(file, footer + kProvenanceOffsetAt);
  const std::uint64_t directory = getAt<std::uint64_t>(file, footer + kDirectoryOffsetAt);
  if (provenance <= directory && directory <= footer) {
    setAt(file, footer + kProvenanceChecksumAt, hashOf(file, provenance, directory, identity));
    setAt(file, footer + kDirectoryChecksumAt, hashOf(file, directory, footer, identity));
  }
  setAt(file, footer + kFooterChecksumAt,
        hashOf(file, footer, footer + kFooterChecksumAt, identity));
  setAt(file, kHeaderChecksumAt, hashOf(file, 0, kHeaderChecksumAt, 0));
}

// Makes the checksums of those pages valid that lie in the file where the directory says. The
// footer must be there.
inline void sealPages(std::string& file) {
  const std::size_t footer = footerAt(file);
  const std::uint64_t identity = getAt<std::uint64_t>(file, 16);
  const std::uint64_t directory = getAt<std::uint64_t>(file, footer + kDirectoryOffsetAt);
  if (directory > footer) return;
  for (std::size_t at = directory; at + kEntryBytes <= footer; at += kEntryBytes) {
    const auto offset = getAt<std::uint64_t>(file, at);
    const auto bytes = getAt<std::uint32_t>(file, at + 8);
    if (offset > file.size() || bytes > file.size() - offset) continue;
    setAt(file, at + 16, hashOf(file, offset, offset + bytes, pageSeed(identity, offset)));
  }
}

// Gives the file at `path` these bytes. In place: a file system may sync a file that is truncated
// and written again, which takes a thousand times as long.
inline void replaceContents(const std::string& path, const std::string& bytes) {
  if (!std::filesystem::exists(path)) std::ofstream(path, std::ios::binary).flush();
  {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  if (std::filesystem::file_size(path) != bytes.size()) {
    std::filesystem::resize_file(path, bytes.size());
  }
}

// Values that break careless arithmetic, around a right value n.
inline std::vector<std::uint64_t> hostileValues(std::uint64_t n) {
  return {0,
          1,
          n - 1,
          n,
          n + 1,
          (std::uint64_t{1} << 31) - 1,
          std::uint64_t{1} << 31,
          (std::uint64_t{1} << 32) - 1,
          std::uint64_t{1} << 32,
          std::uint64_t{1} << 63,
          ~std::uint64_t{0}};
}

}  // namespace surfeit
