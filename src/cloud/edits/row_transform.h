// Rows of a cloud moved by an affine map, channel by channel: positions as points, normals by the
// inverse transpose, vectors, and sizes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// One thread at a time while it is bound, afterwards safe from any.
class RowTransform {
 public:
  // The rows of a 3x4 matrix: x' = m[0] x + m[1] y + m[2] z + m[3].
  using Matrix = std::array<double, 12>;

  // kInvalidArgument unless all values are finite and the map can be inverted. With `growth` each
  // row stands for so many: areas and powers of photons grow by it, radii by its root.
  static Result<RowTransform> create(const Matrix& matrix, double growth = 1);
  // The matrix behind a quarter turn that brings axis `from` to axis `to`.
  static Matrix behindTurn(Matrix matrix, UpAxis from, UpAxis to);

  // Whether nothing is moved; sizes may grow all the same.
  bool isIdentity() const;
  // Whether it scales all directions alike.
  bool isUniform() const;

  // What becomes of a channel.
  enum class Role : std::uint8_t {
    kNone,
    kPoint,
    kVector,
    kDirection,
    kNormal,
    kLength,
    kArea,
    kPower
  };
  static Role roleOf(const RowChannel& channel);
  // Whether it grows where a row stands for several.
  static bool isSize(Role role);

  // Gives integers that it will change a type of floats that holds them. Places that it translates
  // become doubles: what a format has too few digits for is its writer's to tell.
  void widenTypes(std::vector<RowProperty>& properties) const;
  // The same of the integers among sizes, which someone else will change.
  static void widenSizes(std::vector<RowProperty>& properties);
  // Rows will be those of `element`. What it does to each channel follows from the names
  // (surfeit/convert.h).
  void bind(const RowLayout& element);
  // Of these rows, what cannot be moved properly, one sentence each.
  const std::vector<std::string>& notes() const { return notes_; }

  // Moves `count` packed rows in place. All in double precision until they are stored.
  void apply(std::byte* rows, std::size_t count) const;

 private:
  struct Task {  // properties of a channel that change together
    Role role = Role::kNone;
    std::vector<RowProperty> properties;  // 3, or 1 of lengths and areas
  };

  explicit RowTransform(const Matrix& matrix);
  bool changes(Role role) const;
  void noteWhatStays(const std::vector<RowChannel>& channels);
  void applyTriple(const Task& task, std::byte* rows, std::size_t count) const;
  void applyScale(const Task& task, std::byte* rows, std::size_t count) const;

  Matrix matrix_;
  std::array<double, 9> normal_matrix_{};  // the inverse transpose, up to a positive factor
  double determinant_ = 1, growth_ = 1;
  std::size_t row_bytes_ = 0;
  std::vector<Task> tasks_;
  std::vector<std::string> notes_;
};

}  // namespace surfeit
