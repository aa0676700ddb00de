#include "sim/files/terminal.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "sim/files/atomic_output.h"

namespace abbe::sim {

using nlohmann::ordered_json;

void enable_write_errors() {
  std::signal(SIGXFSZ, SIG_IGN);
  // Opened in the wrong direction, so that using the stream is an error instead of silence.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF)
      static_cast<void>(::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY));
}

void flush_output() {
  // An earlier failed write leaves the error flag set, while fflush of an empty buffer succeeds.
  errno = 0;
  const bool is_flushed = std::fflush(stdout) == 0;
  const int reason = errno;
  if (is_flushed && std::ferror(stdout) == 0) return;
  const std::string why = is_flushed ? "an earlier write failed" : std::strerror(reason);
  throw OutputFailure("standard output: cannot be written: " + why);
}

ordered_json single_lined(const ordered_json& json) {
  if (json.is_string()) return escaped(json.get_ref<const std::string&>());
  if (json.is_array()) {
    ordered_json all = ordered_json::array();
    for (const ordered_json& one : json) all.push_back(single_lined(one));
    return all;
  }
  if (!json.is_object()) return json;
  ordered_json all = ordered_json::object();
  for (const auto& [key, value] : json.items()) all[escaped(key)] = single_lined(value);
  return all;
}

}  // namespace abbe::sim
