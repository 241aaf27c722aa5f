// Walks through values of Houdini's binary JSON: what the readers of points and of curves share.
#pragma once

#include <cstdint>
#include <string>

#include "cloud/houdini/bgeo_json_cursor.h"
#include "cloud/parts/spooled_input.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. `input` must outlive it.
class BgeoJsonWalk {
 public:
  explicit BgeoJsonWalk(SpooledInput& input) : cursor_(input) {}

 protected:
  using Kind = JsonToken::Kind;

  Status skipValue() {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    return cursor_.skip(token);
  }

  // A map, or an array of keys and values in turn; visit(key) reads the value.
  template <typename Visit>
  Status readPairs(Visit visit) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    return readPairsFrom(token, visit);
  }
  // Behind the token that begins them.
  template <typename Visit>
  Status readPairsFrom(JsonToken token, Visit visit) {
    if (token.kind != Kind::kArrayBegin && token.kind != Kind::kMapBegin) {
      return cursor_.damaged("expected keys and values");
    }
    while (true) {
      SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      if (token.kind == Kind::kArrayEnd || token.kind == Kind::kMapEnd) return {};
      if (token.kind != Kind::kText) return cursor_.damaged("expected a key");
      SURFEIT_RETURN_IF_ERROR(visit(token.text));
    }
  }

  // An array; visit(token) reads the item that begins with the token.
  template <typename Visit>
  Status readItems(Visit visit) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    if (token.kind != Kind::kArrayBegin) return cursor_.damaged("expected an array");
    while (true) {
      SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
      if (token.kind == Kind::kArrayEnd) return {};
      if (token.kind == Kind::kEnd) return cursor_.damaged("file ends early, inside an array");
      SURFEIT_RETURN_IF_ERROR(visit(token));
    }
  }

  Status readCount(std::uint64_t& count) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    if (token.kind != Kind::kInteger || token.integer < 0) {
      return cursor_.damaged("expected a number, 0 or more");
    }
    count = static_cast<std::uint64_t>(token.integer);
    return {};
  }

  Status readText(std::string& text) {
    JsonToken token;
    SURFEIT_RETURN_IF_ERROR(cursor_.next(token));
    if (token.kind != Kind::kText) return cursor_.damaged("expected a text");
    text = token.text;
    return {};
  }

  BgeoJsonCursor cursor_;
};

}  // namespace surfeit
