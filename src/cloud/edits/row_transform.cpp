#include "cloud/edits/row_transform.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

namespace surfeit {
namespace {

constexpr std::size_t kBlockRows = 256;         // whose values stay in the first-level cache
constexpr double kUniformTolerance = 1e-6;      // of squared lengths
constexpr double kLeastRelativeVolume = 1e-12;  // below, what is left of a box is flat

using Column = std::array<double, kBlockRows>;

// Vectors whose length means nothing, or is to stay 1.
constexpr std::string_view kDirections[] = {"view", "incident", "bent_normal",
                                            "illumination_direction"};
// Triples that lie in no space that moves.
constexpr std::string_view kTextureNames[] = {"uv", "uvw", "st", "texturecoord", "texcoord"};
constexpr std::string_view kLengths[] = {"radius", "pscale", "width"};

template <typename Names>
bool holds(const Names& names, std::string_view name) {
  return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

std::string lowerCase(std::string_view name) {
  std::string lower(name);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

// Whether channels are coefficients of spherical harmonics: sh0_r .. sh8_b, as the gather has them.
bool isHarmonic(const RowChannel& channel) {
  return channel.name.size() == 3 && channel.name.starts_with("sh") && channel.name[2] >= '0' &&
         channel.name[2] <= '9';
}

void load(const RowProperty& property, const std::byte* rows, std::size_t row_bytes,
          std::size_t count, Column& column) {
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    const std::byte* from = rows + property.offset;
    for (std::size_t i = 0; i < count; ++i, from += row_bytes) {
      T value;
      std::memcpy(&value, from, sizeof value);
      column[i] = static_cast<double>(value);
    }
  });
}

void store(const Column& column, const RowProperty& property, std::byte* rows,
           std::size_t row_bytes, std::size_t count) {
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    std::byte* to = rows + property.offset;
    for (std::size_t i = 0; i < count; ++i, to += row_bytes) {
      const T value = static_cast<T>(column[i]);
      std::memcpy(to, &value, sizeof value);
    }
  });
}

// Rows of cofactors: the inverse transpose times the determinant.
std::array<double, 9> cofactors(const RowTransform::Matrix& m) {
  return {m[5] * m[10] - m[6] * m[9], m[6] * m[8] - m[4] * m[10], m[4] * m[9] - m[5] * m[8],
          m[2] * m[9] - m[1] * m[10], m[0] * m[10] - m[2] * m[8], m[1] * m[8] - m[0] * m[9],
          m[1] * m[6] - m[2] * m[5],  m[2] * m[4] - m[0] * m[6],  m[0] * m[5] - m[1] * m[4]};
}

// Makes floats of the integers of channels with such a role, and doubles of the floats of places
// that a translation moves: far from 0 they would lose digits.
template <typename Condition>
void widenWhere(std::vector<RowProperty>& properties, bool is_translation,
                const Condition& condition) {
  RowLayout element;
  element.properties = properties;
  packRow(element);
  for (const RowChannel& channel : channelsOf(element)) {
    const RowTransform::Role role = RowTransform::roleOf(channel);
    if (!condition(role)) continue;
    const bool has_far_places = is_translation && role == RowTransform::Role::kPoint;
    for (const std::size_t i : channel.properties) {
      ValueType& type = properties[i].type;
      if (has_far_places) type = ValueType::kFloat64;
      if (isFloatType(type)) continue;
      type = valueTypeBytes(type) <= 2 ? ValueType::kFloat32 : ValueType::kFloat64;
    }
  }
}

}  // namespace

RowTransform::RowTransform(const Matrix& matrix)
    : matrix_(matrix), normal_matrix_(cofactors(matrix)) {
  determinant_ =
      matrix[0] * normal_matrix_[0] + matrix[1] * normal_matrix_[1] + matrix[2] * normal_matrix_[2];
  // Normals keep their length, so only the sign of the determinant counts
  if (determinant_ < 0) {
    for (double& value : normal_matrix_) value = -value;
  }
}

Result<RowTransform> RowTransform::create(const Matrix& matrix, double growth) {
  for (const double value : matrix) {
    if (!std::isfinite(value)) {
      return Status::invalidArgument(
          fmt::format("transform: found {}, expected finite numbers", value));
    }
  }
  RowTransform transform(matrix);
  transform.growth_ = growth;
  double edges = 1;  // of what becomes of a unit cube
  for (std::size_t axis = 0; axis < 3; ++axis) {
    edges *= std::hypot(matrix[axis], matrix[4 + axis], matrix[8 + axis]);
  }
  const double volume = std::abs(transform.determinant_);
  if (!(volume > kLeastRelativeVolume * edges) || !std::isfinite(edges) || !std::isnormal(volume)) {
    return Status::invalidArgument(fmt::format(
        "transform: found a determinant of {}, expected a map that keeps volumes apart from 0",
        transform.determinant_));
  }
  return transform;
}

RowTransform::Matrix RowTransform::behindTurn(Matrix matrix, UpAxis from, UpAxis to) {
  for (std::size_t row = 0; row < 3; ++row) {
    double& of_from = matrix[4 * row + static_cast<std::size_t>(from)];
    double& of_to = matrix[4 * row + static_cast<std::size_t>(to)];
    of_from = std::exchange(of_to, -of_from);
  }
  return matrix;
}

bool RowTransform::isIdentity() const {
  return matrix_ == Matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
}

bool RowTransform::isUniform() const {
  const double square = std::pow(std::abs(determinant_), 2.0 / 3);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      double dot = 0;
      for (std::size_t row = 0; row < 3; ++row) dot += matrix_[4 * row + a] * matrix_[4 * row + b];
      if (!(std::abs(dot - (a == b ? square : 0)) <= kUniformTolerance * square)) return false;
    }
  }
  return true;
}

RowTransform::Role RowTransform::roleOf(const RowChannel& channel) {
  if (channel.properties.size() == 1) {
    if (holds(kLengths, channel.name)) return Role::kLength;
    return channel.name == "area" ? Role::kArea : Role::kNone;
  }
  if (channel.properties.size() != 3) return Role::kNone;
  if (channel.name == "power") return Role::kPower;
  switch (channel.kind) {
    case ChannelKind::kPoint:
      return Role::kPoint;
    case ChannelKind::kNormal:
      return Role::kNormal;
    case ChannelKind::kVector:
      if (holds(kTextureNames, lowerCase(channel.name))) return Role::kNone;
      return holds(kDirections, channel.name) ? Role::kDirection : Role::kVector;
    default:
      return Role::kNone;
  }
}

bool RowTransform::isSize(Role role) {
  return role == Role::kLength || role == Role::kArea || role == Role::kPower;
}

bool RowTransform::changes(Role role) const {
  if (isSize(role) && growth_ != 1) return true;
  return role != Role::kNone && role != Role::kPower && !isIdentity();
}

void RowTransform::widenTypes(std::vector<RowProperty>& properties) const {
  const bool is_translation = matrix_[3] != 0 || matrix_[7] != 0 || matrix_[11] != 0;
  widenWhere(properties, is_translation, [this](Role role) { return changes(role); });
}

void RowTransform::widenSizes(std::vector<RowProperty>& properties) {
  widenWhere(properties, false, isSize);
}

void RowTransform::bind(const RowLayout& element) {
  row_bytes_ = element.row_bytes;
  tasks_.clear();
  notes_.clear();
  const std::vector<RowChannel> channels = channelsOf(element);
  for (const RowChannel& channel : channels) {
    Task task{roleOf(channel), {}};
    if (!changes(task.role)) continue;
    for (const std::size_t i : channel.properties) task.properties.push_back(element.properties[i]);
    tasks_.push_back(std::move(task));
  }
  if (!isIdentity()) noteWhatStays(channels);
}

void RowTransform::noteWhatStays(const std::vector<RowChannel>& channels) {
  const bool has_sizes = std::any_of(tasks_.begin(), tasks_.end(), [](const Task& task) {
    return task.role == Role::kLength || task.role == Role::kArea;
  });
  if (has_sizes && !isUniform()) {
    notes_.push_back(
        "the scale differs by direction: radii and areas are multiplied by its mean, "
        "disks stay round");
  }
  std::vector<std::string_view> staying;
  for (const RowChannel& channel : channels) {
    if (channel.kind == ChannelKind::kMatrix || isHarmonic(channel)) {
      staying.push_back(channel.name);
    }
  }
  if (!staying.empty()) {
    notes_.push_back(fmt::format("matrices and spherical harmonics stay as they are: {}",
                                 fmt::join(staying, " ")));
  }
}

void RowTransform::apply(std::byte* rows, std::size_t count) const {
  for (std::size_t begin = 0; begin < count; begin += kBlockRows) {
    const std::size_t block_rows = std::min(kBlockRows, count - begin);
    std::byte* const block = rows + begin * row_bytes_;
    for (const Task& task : tasks_) {
      if (task.properties.size() == 3 && task.role != Role::kPower) {
        applyTriple(task, block, block_rows);
      } else {
        applyScale(task, block, block_rows);
      }
    }
  }
}

void RowTransform::applyTriple(const Task& task, std::byte* rows, std::size_t count) const {
  Column x, y, z;
  load(task.properties[0], rows, row_bytes_, count, x);
  load(task.properties[1], rows, row_bytes_, count, y);
  load(task.properties[2], rows, row_bytes_, count, z);

  // The linear part, and where the origin goes
  std::array<double, 9> m = normal_matrix_;
  std::array<double, 3> t{};
  if (task.role != Role::kNormal) {
    for (std::size_t row = 0; row < 3; ++row) {
      std::copy_n(&matrix_[4 * row], 3, &m[3 * row]);
      if (task.role == Role::kPoint) t[row] = matrix_[4 * row + 3];
    }
  }
  const bool keeps_length = task.role == Role::kNormal || task.role == Role::kDirection;
  for (std::size_t i = 0; i < count; ++i) {
    const double vx = x[i], vy = y[i], vz = z[i];
    double wx = m[0] * vx + m[1] * vy + m[2] * vz + t[0];
    double wy = m[3] * vx + m[4] * vy + m[5] * vz + t[1];
    double wz = m[6] * vx + m[7] * vy + m[8] * vz + t[2];
    if (keeps_length) {
      const double length = std::sqrt(wx * wx + wy * wy + wz * wz);
      // A normal of zero, which says that the surfel is a sphere, stays one
      const double scale = length > 0 ? std::sqrt(vx * vx + vy * vy + vz * vz) / length : 1;
      wx *= scale;
      wy *= scale;
      wz *= scale;
    }
    x[i] = wx;
    y[i] = wy;
    z[i] = wz;
  }
  store(x, task.properties[0], rows, row_bytes_, count);
  store(y, task.properties[1], rows, row_bytes_, count);
  store(z, task.properties[2], rows, row_bytes_, count);
}

void RowTransform::applyScale(const Task& task, std::byte* rows, std::size_t count) const {
  const double length = std::cbrt(std::abs(determinant_));
  const double scale = task.role == Role::kPower  ? growth_
                       : task.role == Role::kArea ? length * length * growth_
                                                  : length * std::sqrt(growth_);
  for (const RowProperty& property : task.properties) {
    Column values;
    load(property, rows, row_bytes_, count, values);
    for (std::size_t i = 0; i < count; ++i) values[i] *= scale;
    store(values, property, rows, row_bytes_, count);
  }
}

}  // namespace surfeit
