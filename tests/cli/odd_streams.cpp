// Runs a program whose standard output or error takes nothing more, for tests:
//
//   odd_streams full|broken|hungup DESCRIPTOR PROGRAM ARGUMENT...
//
// full: a pipe that is full and does not block; broken: a pipe that nobody reads; hungup: a
// terminal that is gone.
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace {

int fullPipe() {
  int ends[2];
  if (::pipe(ends) != 0) return -1;
  // The end to read stays open, without a reader
  ::fcntl(ends[1], F_SETFL, O_NONBLOCK);
  const std::string bytes(4096, ' ');
  while (::write(ends[1], bytes.data(), bytes.size()) > 0) {
  }
  while (::write(ends[1], bytes.data(), 1) > 0) {
  }
  return ends[1];
}

int brokenPipe() {
  int ends[2];
  if (::pipe(ends) != 0) return -1;
  ::close(ends[0]);
  return ends[1];
}

int hungUpTerminal() {
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY);
  if (terminal < 0 || ::grantpt(terminal) != 0 || ::unlockpt(terminal) != 0) return -1;
  const char* const name = ::ptsname(terminal);
  const int stream = name != nullptr ? ::open(name, O_RDWR | O_NOCTTY) : -1;
  ::close(terminal);
  return stream;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  const std::string kind = argv[1];
  const int stream = kind == "full"     ? fullPipe()
                     : kind == "broken" ? brokenPipe()
                     : kind == "hungup" ? hungUpTerminal()
                                        : -1;
  if (stream < 0 || ::dup2(stream, std::atoi(argv[2])) < 0) {
    std::perror("odd_streams");
    return 77;
  }
  ::close(stream);
  ::signal(SIGHUP, SIG_IGN);
  ::execv(argv[3], argv + 3);
  return 127;
}
