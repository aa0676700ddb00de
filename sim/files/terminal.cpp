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
  // /dev/null is opened in the wrong direction, so that using the stream fails instead of losing
  // data silently.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF)
      static_cast<void>(::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY));
}

void flush_output() {
  // An earlier failed write leaves the error flag set, while fflush of an empty buffer succeeds.
  errno = 0;
  const bool is_flushed = std::fflush(stdout) == 0;
  const int flush_errno = errno;
  if (is_flushed && std::ferror(stdout) == 0) return;
  const std::string reason = is_flushed ? "an earlier write failed" : std::strerror(flush_errno);
  throw OutputFailure("standard output: cannot be written: " + reason);
}

ordered_json escape_strings(const ordered_json& json) {
  if (json.is_string()) return escaped(json.get_ref<const std::string&>());
  if (json.is_array()) {
    ordered_json array = ordered_json::array();
    for (const ordered_json& element : json) array.push_back(escape_strings(element));
    return array;
  }
  if (!json.is_object()) return json;
  ordered_json object = ordered_json::object();
  for (const auto& [key, value] : json.items()) object[escaped(key)] = escape_strings(value);
  return object;
}

}  // namespace abbe::sim
