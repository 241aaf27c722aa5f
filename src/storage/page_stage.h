// A node's own copy of the pages of a scene that its tasks have read: a sparse file in a directory
// of the node, in which a page has the place that it has in the scene. Tasks of a node share it, at
// once and one after the other.
//
// Nothing says which pages are there. A reader takes what lies at the place of a page, and the
// page's checksum, which is that of scene and place, tells whether it is the page; else it reads
// the scene, and keeps what it has read. So a task that is killed, two that write at once, and a
// damaged copy do no harm, and nothing has to be locked or synced. The name of the copy tells
// scenes apart.
//
// Failures are no failures of the job: what the copy cannot take or give is read from the scene.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "storage/positional_file.h"

namespace surfeit {

// Safe from any thread.
class PageStage {
 public:
  struct Options {
    std::string directory;
    std::uint64_t limit_bytes = 0;  // of all copies in the directory, about; 0: what the disk has
  };
  // This part of the disk stays free, for temporary files.
  static constexpr std::uint64_t kFreePart = 10;

  // The copy of a scene of this identity and these places (PageFile::directoryChecksum).
  PageStage(const Options& options, std::uint64_t identity, std::uint64_t directory_checksum);

  // The bytes at the place of a page, as a view into `buffer`; empty where none were written. They
  // may be anything: whoever asks checks them.
  Bytes read(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const;
  // What was read is the page.
  void countRead(std::size_t size) { bytes_read_ += size; }
  // Keeps a page as the scene has it. `had_other`: read() gave bytes that were no page.
  void keep(std::uint64_t offset, Bytes page, bool had_other);

  std::uint64_t bytesRead() const { return bytes_read_; }
  std::uint64_t bytesKept() const { return bytes_kept_; }
  const std::string& path() const { return path_; }
  // What the user should know, each once.
  std::vector<std::string> takeNotes();

 private:
  bool hasRoom(std::size_t size) const;
  void stop(const std::string& why);

  const Options options_;
  std::string path_;
  PositionalFile file_;             // closed where there is no copy
  std::uint64_t others_bytes_ = 0;  // of other copies in the directory
  std::atomic<bool> keeps_ = false;
  std::atomic<std::uint64_t> bytes_read_ = 0, bytes_kept_ = 0;
  std::mutex mutex_;  // guards what is below
  bool has_told_damage_ = false, has_told_end_ = false;
  std::vector<std::string> notes_;
};

}  // namespace surfeit
