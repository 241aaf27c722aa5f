#include "cloud/text/xyz_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "cloud/ply/ply_number.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"
#include "core/text_case.h"
#include "core/up_comment.h"
#include "storage/byte_output.h"
#include "storage/compression.h"

namespace surfeit {
namespace {

constexpr std::size_t kBufferBytes = 256 << 10;

class XyzWriter final : public RowWriter {
 public:
  XyzWriter(ByteOutput output, RowLayout element, char separator)
      : output_(std::move(output)), element_(std::move(element)), separator_(separator) {
    for (const RowChannel& channel : channelsOf(element_)) {
      if (channel.name == "color" || !isCodedColor(channel)) continue;
      notes_.push_back("integers that code sRGB become linear float32: " + channel.name);
      for (std::size_t i = 0; i < channel.properties.size(); ++i) {
        coded_.push_back({&element_.properties[channel.properties[i]], channel, i});
      }
    }
  }

  Status writeHead(std::vector<std::string> comments) {
    std::string head;
    // Text that says nothing has y up; tables begin with the names of their columns
    for (const UpAxis up : {UpAxis::kX, UpAxis::kY, UpAxis::kZ}) {
      if (separator_ == ',' || up == kDefaultUpAxis) std::erase(comments, upComment(up));
    }
    for (std::string& comment : comments) {
      std::replace_if(
          comment.begin(), comment.end(), [](char c) { return c >= '\0' && c < ' '; }, ' ');
      head += fmt::format("# {}\n", comment);
    }
    if (separator_ == ' ') head += "# ";
    for (const RowProperty& property : element_.properties) {
      head += property.name;
      head += &property == &element_.properties.back() ? '\n' : separator_;
    }
    return output_.append(std::as_bytes(std::span(head)));
  }

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }

  Status writeRows(std::span<const std::byte> rows) override {
    if (is_finished_ || rows.size() % element_.row_bytes != 0) {
      return Status::invalidArgument(
          fmt::format("{}: {} bytes to write, expected whole rows of {} bytes before finish",
                      output_.path(), rows.size(), element_.row_bytes));
    }
    text_.resize(kBufferBytes);
    std::size_t used = 0;
    for (; !rows.empty(); rows = rows.subspan(element_.row_bytes)) {
      for (const RowProperty& property : element_.properties) {
        if (text_.size() - used <= kLongestPlyNumber) {
          SURFEIT_RETURN_IF_ERROR(append(used));
          used = 0;
        }
        char* const begin = text_.data() + used;
        char* const end = format(rows.data(), property, begin);
        *end = &property == &element_.properties.back() ? '\n' : separator_;
        used += static_cast<std::size_t>(end - begin) + 1;
      }
    }
    return append(used);
  }

  Status finish() override {
    if (is_finished_) {
      return Status::invalidArgument(fmt::format("{}: finished twice", output_.path()));
    }
    SURFEIT_RETURN_IF_ERROR(output_.commit());
    is_finished_ = true;
    return {};
  }

 private:
  char* format(const std::byte* row, const RowProperty& property, char* begin) const {
    for (const Coded& coded : coded_) {
      if (&property != coded.property) continue;
      const auto linear =
          static_cast<float>(channelValue(element_, coded.channel, coded.component, row));
      return formatPlyNumber(reinterpret_cast<const std::byte*>(&linear), ValueType::kFloat32,
                             begin);
    }
    return formatPlyNumber(row + property.offset, property.type, begin);
  }

  Status append(std::size_t used) {
    return output_.append(std::as_bytes(std::span(text_).first(used)));
  }

  // Integers of other columns than red, green and blue would be read as they stand.
  struct Coded {
    const RowProperty* property;
    RowChannel channel;
    std::size_t component;
  };

  ByteOutput output_;
  RowLayout element_;
  std::vector<Coded> coded_;
  std::vector<std::string> notes_;
  char separator_;
  std::vector<char> text_;
  bool is_finished_ = false;
};

// Without x, y and z nobody could tell what the columns are; commas would part a name.
Status checkProperties(const std::string& path, const RowLayout& element) {
  for (const char* name : {"x", "y", "z"}) {
    if (element.find(name) == nullptr) {
      return Status::invalidArgument(
          fmt::format("{}: no positions to write, expected properties x, y and z", path));
    }
  }
  for (const RowProperty& property : element.properties) {
    const std::string& name = property.name;
    if (!isPropertyName(name) || name.find_first_of(",;\"") != name.npos || property.is_list) {
      return Status::invalidArgument(
          fmt::format("{}: property {}: expected a scalar with a name of one word without commas",
                      path, quoteText(name)));
    }
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<RowWriter>> createXyz(const std::string& path,
                                             const RowWriterOptions& options) {
  RowLayout element;
  element.name = "vertex";
  element.properties = options.properties;
  packRow(element);
  SURFEIT_RETURN_IF_ERROR(checkProperties(path, element));
  const char separator = hasEnding(withoutCompression(path), ".csv") ? ',' : ' ';
  SURFEIT_ASSIGN_OR_RETURN(ByteOutput output, ByteOutput::create(path, options.progress));
  auto writer = std::make_unique<XyzWriter>(std::move(output), std::move(element), separator);
  SURFEIT_RETURN_IF_ERROR(writer->writeHead(options.comments));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
