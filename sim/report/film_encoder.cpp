#include "sim/report/film_encoder.h"

#include <cstdlib>
#include <stdexcept>

#include <unistd.h>

#include <fmt/format.h>

#include "sim/compensation/child_process.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

/// A path as ffmpeg takes it for a numbered list of pictures.
std::string numbered(const fs::path& folder) {
  std::string text;
  for (const char c : fs::absolute(folder).string())
    text += c == '%' ? std::string("%%") : std::string(1, c);
  return text + "/frame_%05d.png";
}

}  // namespace

std::optional<fs::path> found_on_path(const std::string& program) {
  const char* const list = std::getenv("PATH");
  std::string_view rest = list == nullptr ? "" : list;
  while (!rest.empty()) {
    const std::size_t colon = std::min(rest.find(':'), rest.size());
    const fs::path file = fs::path(rest.substr(0, colon)) / program;
    rest.remove_prefix(std::min(colon + 1, rest.size()));
    std::error_code none;
    if (fs::is_regular_file(file, none) && ::access(file.c_str(), X_OK) == 0) return file;
  }
  return std::nullopt;
}

std::vector<std::string> encoder_command(const std::string& ffmpeg, const FilmEncoding& encoding,
                                         const fs::path& film) {
  std::vector<std::string> command{ffmpeg,
                                   "-hide_banner",
                                   "-loglevel",
                                   "error",
                                   "-nostdin",
                                   "-y",
                                   "-framerate",
                                   fmt::format("{}", encoding.fps),
                                   "-start_number",
                                   "1",
                                   "-i",
                                   numbered(encoding.frames),
                                   "-frames:v",
                                   std::to_string(encoding.count),
                                   "-pix_fmt",
                                   "yuv420p"};
  const std::vector<std::string> h264{"-c:v", "libx264", "-preset",   "veryfast",
                                      "-crf", "20",      "-movflags", "+faststart"};
  const std::vector<std::string> vp9{"-c:v",      "libvpx-vp9", "-deadline", "realtime",
                                     "-cpu-used", "6",          "-crf",      "32",
                                     "-b:v",      "0",          "-row-mt",   "1"};
  const auto& format = film.extension() == ".webm" ? vp9 : h264;
  command.insert(command.end(), format.begin(), format.end());
  command.push_back(fs::absolute(film).string());
  return command;
}

std::string shell_text(const std::vector<std::string>& command) {
  constexpr std::string_view plain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+./:%=,";
  std::string text;
  for (const std::string& word : command) {
    if (!text.empty()) text += ' ';
    if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) {
      text += word;
      continue;
    }
    text += '\'';
    for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    text += '\'';
  }
  return text;
}

void encode(const std::vector<std::string>& command, const std::function<void()>& waiting) {
  constexpr double most_s = 86400.0;
  compensation::ChildProcess child(command, {}, waiting);
  try {
    child.finish("", most_s);
  } catch (const compensation::ChildFault& fault) {
    throw std::runtime_error(
        fmt::format("{}: {} {}", command.front(), fault.what(), child.last_words()));
  }
}

}  // namespace abbe::sim
