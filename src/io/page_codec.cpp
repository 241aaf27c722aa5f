#include "io/page_codec.h"

#include <fmt/format.h>
#include <zstd.h>

#include <memory>

namespace surfeit {
namespace {

// Level 3: levels 1 to 6 differ by 2 % in size on quantized pages, and 3 is the library's default.
constexpr int kCompressionLevel = 3;

struct FreeContext {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

}  // namespace

Status compressPage(Bytes payload, std::vector<std::byte>& stored) {
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeContext> context(ZSTD_createCCtx());
  if (context == nullptr) return Status::failed("zstd: no memory for a compression context");
  stored.resize(ZSTD_compressBound(payload.size()));
  const std::size_t bytes = ZSTD_compressCCtx(context.get(), stored.data(), stored.size(),
                                              payload.data(), payload.size(), kCompressionLevel);
  if (ZSTD_isError(bytes)) return Status::failed(fmt::format("zstd: {}", ZSTD_getErrorName(bytes)));
  stored.resize(bytes);
  return {};
}

Status decompressPage(Bytes stored, std::span<std::byte> payload) {
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
  if (context == nullptr) return Status::failed("zstd: no memory for a decompression context");
  const std::size_t bytes = ZSTD_decompressDCtx(context.get(), payload.data(), payload.size(),
                                                stored.data(), stored.size());
  if (ZSTD_isError(bytes)) {
    return Status::corruption(fmt::format("zstd: {}", ZSTD_getErrorName(bytes)));
  }
  if (bytes != payload.size()) {
    return Status::corruption(fmt::format("decoded size {}, expected {}", bytes, payload.size()));
  }
  return {};
}

}  // namespace surfeit
