// Houdini's binary JSON, token by token:
//
//   [ 7F | magic 4 | tokens ]
//
// Numbers, texts, maps and arrays are as in JSON; uniform arrays have one type byte, a length and
// raw values. Texts that are used more than once are defined with a number, and then referred to by
// it. A length is a byte below F1, or F2 and a u16, F4 and a u32, F8 and an i64. The magic tells
// the byte order of all that follows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cloud/parts/spooled_input.h"
#include "cloud/parts/stored_values.h"
#include "surfeit/status.h"

namespace surfeit {

bool startsBinaryJson(std::string_view first_bytes);

struct JsonToken {
  enum class Kind : std::uint8_t {
    kNull,
    kBool,
    kInteger,
    kReal,
    kText,
    kMapBegin,
    kMapEnd,
    kArrayBegin,
    kArrayEnd,
    kUniformArray,
    kEnd  // of the file
  };
  Kind kind = Kind::kNull;
  std::int64_t integer = 0;  // also of a bool
  double real = 0;           // also of an integer
  std::string text;          // the first kMaxJsonText bytes
  // Of a uniform array
  std::optional<StoredType> type;  // nothing: bools, packed in u32, or texts
  bool is_bools = false;
  std::uint64_t length = 0;  // values
  std::uint64_t offset = 0;  // of the first
};

inline constexpr std::size_t kMaxJsonText = 1024;

// One thread at a time; takes 64 KiB, and what texts are defined: at most 4096.
class BgeoJsonCursor {
 public:
  // `input` must outlive the cursor.
  explicit BgeoJsonCursor(SpooledInput& input) : input_(input) {}

  // Looks at the first five bytes.
  Status start();
  // Whether values have the other byte order than this machine's.
  bool isSwapped() const { return is_swapped_; }

  // The next token; the values of uniform arrays are passed over. kCorruption, naming the byte,
  // for what is no token or does not fit in the file.
  Status next(JsonToken& token);
  // Of the next token.
  std::uint64_t offset() const { return offset_; }
  // Passes over the rest of the value that begins with `token`.
  Status skip(const JsonToken& token);

  // The bits of a uniform array of bools.
  Status readBools(const JsonToken& token, std::vector<bool>& bools);
  // The values of a uniform array of numbers, as doubles; it has at most 4096.
  Status readNumbers(const JsonToken& token, std::vector<double>& numbers);

  // kCorruption: "PATH: byte N: WHAT".
  Status damaged(std::string_view what) const;

 private:
  template <typename T>
  Status get(T& value);
  Status getLength(std::uint64_t& length);
  Status getText(std::string& text);
  Status advance(std::uint64_t bytes);
  Status define();
  Status beginUniform(JsonToken& token);
  template <typename T>
  Status getInteger(JsonToken& token);
  template <typename T>
  Status getReal(JsonToken& token);

  SpooledInput& input_;
  bool is_swapped_ = false;
  std::uint64_t offset_ = 0;
  std::uint64_t window_begin_ = 0;
  Bytes window_;
  AlignedBuffer buffer_;
  std::unordered_map<std::uint64_t, std::string> defined_;
};

}  // namespace surfeit
