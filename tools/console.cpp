#include "tools/console.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>

#include "tools/console_progress.h"

namespace surfeit {
namespace {

constexpr int kPollMs = 100;
std::atomic<int> patience_ms{1000};  // for readers of standard error that do not read

// Waits until a descriptor that does not block takes more; false when it is not worth it.
bool waitToWrite(int descriptor) {
  if (descriptor == STDERR_FILENO && patience_ms.fetch_sub(kPollMs) <= 0) {
    patience_ms = 0;
    return false;
  }
  pollfd wanted{descriptor, POLLOUT, 0};
  ::poll(&wanted, 1, kPollMs);
  return ConsoleProgress::cancelSignal() == 0;
}

// Returns the errno of a failure, or 0.
int writeAll(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      if (!waitToWrite(descriptor)) return EAGAIN;
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

// Bytes of the UTF-8 character that `text` begins with; 0 when it begins with none, or with a
// control character.
std::size_t printableBytes(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) {
    const bool is_control = (first < 0x20 && first != '\n' && first != '\t') || first == 0x7f;
    return is_control ? 0 : 1;
  }
  const std::size_t bytes = first >= 0xc2 && first < 0xe0   ? 2
                            : first >= 0xe0 && first < 0xf0 ? 3
                            : first >= 0xf0 && first < 0xf5 ? 4
                                                            : 0;
  if (bytes == 0 || text.size() < bytes) return 0;
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  // The control characters of 8 bits; forms that are longer than needed
  if ((first == 0xc2 && byte(1) < 0xa0) || (first == 0xe0 && byte(1) < 0xa0) ||
      (first == 0xf0 && byte(1) < 0x90)) {
    return 0;
  }
  return bytes;
}

}  // namespace

void prepareStreams() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  // The root directory is always there; as it is open for reading, writing to it is EBADF
  for (int opened = STDIN_FILENO; opened >= STDIN_FILENO && opened <= STDERR_FILENO;) {
    opened = ::open("/", O_RDONLY | O_DIRECTORY);
    if (opened > STDERR_FILENO) ::close(opened);
  }
}

std::string printable(std::string_view text) {
  std::string printable;
  printable.reserve(text.size());
  while (!text.empty()) {
    const std::size_t bytes = printableBytes(text);
    if (bytes > 0) {
      printable += text.substr(0, bytes);
    } else {
      printable += fmt::format("\\x{:02x}", static_cast<unsigned char>(text.front()));
    }
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return printable;
}

void tell(std::string_view text) { tellRaw(printable(text)); }

void tellRaw(std::string_view bytes) { writeAll(STDERR_FILENO, bytes); }

Status writeAnswer(std::string_view text) {
  const int error = writeAll(STDOUT_FILENO, printable(text));
  if (error == 0) return {};
  if (ConsoleProgress::cancelSignal() != 0) return Status::interrupted();
  return Status::ioError(
      fmt::format("standard output: cannot write the answer: {}", std::strerror(error)));
}

}  // namespace surfeit
