// A node's own copy of the pages of a scene that its tasks have read: a sparse file in a directory
// of the node, in which every byte has the place that it has in the scene. Tasks of a node share
// it, at once and one after the other.
//
// What is read of the scene comes in chunks, as a shared file system likes it: neighbours along the
// curve lie beside each other, and are read soon. Nothing says which chunks are there. A reader
// takes what lies at the place of a page, and the page's checksum, which is that of scene and
// place, tells whether it is the page. So a task that is killed, two that write at once, and a
// damaged copy do no harm, and nothing has to be locked or synced. The name of the copy tells
// scenes apart.
//
// Failures are no failures of the job: what the copy cannot take or give is read from the scene.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "storage/file.h"

namespace surfeit {

// Safe from any thread.
class PageStage {
 public:
  struct Options {
    std::string directory;
    std::uint64_t limit_bytes = 0;  // of all copies in the directory, about; 0: what the disk has
    std::uint64_t chunk_bytes = std::uint64_t{256} << 10;  // a multiple of kDirectAlignment
  };
  // This part of the disk stays free, for temporary files.
  static constexpr std::uint64_t kFreePart = 10;
  // What it takes: two chunks, which a page may lie in.
  static constexpr std::uint64_t kMemoryBytes = std::uint64_t{1} << 20;

  // What tells scenes apart: identity and checksum of the directory (PageFile).
  struct Scene {
    std::uint64_t identity = 0, directory_checksum = 0, bytes = 0;
  };
  PageStage(const Options& options, const Scene& scene);

  // The bytes of a page of `scene`, as a view into `buffer`: from the copy, else from the scene,
  // and then they are kept with all of their chunk. Empty where neither has bytes that are the
  // page; then the scene is to be asked for the page alone, which tells why.
  using IsPage = std::function<bool(Bytes)>;
  Bytes find(const InputFile& scene, std::uint64_t offset, std::size_t size, const IsPage& isPage,
             AlignedBuffer& buffer);

  std::uint64_t bytesRead() const { return bytes_read_; }  // of pages, from the copy
  std::uint64_t bytesKept() const { return bytes_kept_; }  // of chunks
  const std::string& path() const { return path_; }
  // What the user should know, each once.
  std::vector<std::string> takeNotes();

 private:
  Bytes read(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const;
  struct Range {
    std::uint64_t begin = 0, end = 0;  // in the scene
  };
  Range chunksOf(std::uint64_t offset, std::size_t size) const;
  Range lackingChunks(std::uint64_t offset, std::size_t size, Bytes staged) const;
  bool hasRoom(std::uint64_t size) const;
  void keep(std::uint64_t offset, Bytes chunks);
  void tellDamage(std::uint64_t offset);
  void stop(const std::string& why);

  const Options options_;
  const std::uint64_t scene_bytes_;
  const std::string path_;
  PositionalFile file_;             // closed where there is no copy
  std::uint64_t others_bytes_ = 0;  // of other copies in the directory
  std::atomic<bool> keeps_ = false;
  std::atomic<std::uint64_t> bytes_read_ = 0, bytes_kept_ = 0;
  std::mutex chunk_mutex_;  // guards chunk_: one thread reads the scene at a time
  AlignedBuffer chunk_;
  std::mutex notes_mutex_;  // guards what is below
  bool has_told_damage_ = false, has_told_end_ = false;
  std::vector<std::string> notes_;
};

}  // namespace surfeit
