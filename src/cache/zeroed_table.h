// An array that begins as zeros, and takes memory where it is first touched: tables with room for
// far more than is used.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <new>
#include <type_traits>

namespace surfeit {

// `T` must mean its initial value with all bytes zero. Throws std::bad_alloc when the address space
// cannot be had.
template <typename T>
class ZeroedTable {
 public:
  static_assert(std::is_trivially_destructible_v<T>);
  explicit ZeroedTable(std::size_t count) : bytes_(count * sizeof(T)) {
    if (bytes_ == 0) return;
    void* const mapping = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE,
                                 MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapping == MAP_FAILED) throw std::bad_alloc();
    entries_ = static_cast<T*>(mapping);
  }
  ZeroedTable(const ZeroedTable&) = delete;
  ZeroedTable& operator=(const ZeroedTable&) = delete;
  ~ZeroedTable() {
    if (entries_ != nullptr) ::munmap(entries_, bytes_);
  }

  T& operator[](std::size_t i) { return entries_[i]; }
  const T& operator[](std::size_t i) const { return entries_[i]; }

 private:
  std::size_t bytes_;
  T* entries_ = nullptr;
};

}  // namespace surfeit
