#include "render/bytes.h"

#include <cerrno>
#include <cstdio>
#include <system_error>

namespace abbe::render {

void write_bytes(const std::filesystem::path& path, std::string_view bytes) {
  const auto fail = [&](int reason) {
    throw std::system_error(reason, std::generic_category(), path.string());
  };
  std::FILE* stream = std::fopen(path.c_str(), "wb");
  if (stream == nullptr) fail(errno);
  errno = 0;
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), stream) == bytes.size();
  const int reason = errno;
  // a full disk may show only when the buffer is handed over
  const bool closed = std::fclose(stream) == 0;
  if (!written) fail(reason != 0 ? reason : EIO);
  if (!closed) fail(errno);
}

}  // namespace abbe::render
