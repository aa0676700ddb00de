#include "sim/output.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace abbe::sim {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& reason) {
  throw OutputFailure(file.string() + ": cannot be written: " + reason);
}

void write_text(const std::filesystem::path& file, std::string_view text) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  if (stream == nullptr) fail(file, std::strerror(errno));
  const bool written = std::fwrite(text.data(), 1, text.size(), stream) == text.size();
  const int reason = errno;
  if (std::fclose(stream) != 0 || !written) fail(file, std::strerror(written ? errno : reason));
}

/// A full disk may show only here.
void flush(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY);
  if (descriptor < 0) fail(file, std::strerror(errno));
  const int failed = ::fsync(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  if (failed != 0 && failed != EINVAL && failed != EROFS) fail(file, std::strerror(failed));
}

}  // namespace

void write_file(const std::filesystem::path& file,
                const std::function<void(const std::filesystem::path&)>& write) {
  // the ending stays last: writers choose the format by it
  const std::filesystem::path temporary =
      file.parent_path() /
      (".unfinished-" + std::to_string(::getpid()) + "-" + file.filename().string());
  std::error_code ignored;
  try {
    write(temporary);
    flush(temporary);
    std::error_code error;
    std::filesystem::rename(temporary, file, error);
    if (error) fail(file, error.message());
  } catch (const OutputFailure& failure) {
    std::filesystem::remove(temporary, ignored);
    throw;
  } catch (const std::exception& failure) {
    std::filesystem::remove(temporary, ignored);
    fail(file, failure.what());
  }
}

void write_file(const std::filesystem::path& file, std::string_view text) {
  write_file(file, [&](const std::filesystem::path& temporary) { write_text(temporary, text); });
}

void prepare_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) fail(folder, error.message());
  const std::filesystem::path probe = folder / (".unfinished-" + std::to_string(::getpid()));
  write_text(probe, "probe\n");
  std::filesystem::remove(probe, error);
}

}  // namespace abbe::sim
