#include "sim/files/standard_output.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <unistd.h>

#include "sim/files/output_failure.h"

namespace abbe::sim {

void make_writes_fail() {
  std::signal(SIGXFSZ, SIG_IGN);
  // opened the wrong way round, so that using it is an error and not silence
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF)
      static_cast<void>(::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY));
}

void flush_output() {
  errno = 0;
  const bool is_flushed = std::fflush(stdout) == 0;
  const int reason = errno;
  if (is_flushed && std::ferror(stdout) == 0) return;
  const std::string why = is_flushed ? "an earlier write failed" : std::strerror(reason);
  throw OutputFailure("standard output: cannot be written: " + why);
}

}  // namespace abbe::sim
