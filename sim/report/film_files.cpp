#include "sim/report/film_files.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <future>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "kinematics/bad_input.h"
#include "sim/compensation/child_process.h"

#if ABBE_RENDER
#include "render/film.h"
#include "render/picture.h"
#include "sim/report/program_film.h"
#endif

namespace abbe::sim {

namespace {

namespace fs = std::filesystem;

/// Returns the pattern of the frames' file names for ffmpeg; a % of the folder is escaped.
std::string frame_pattern(const fs::path& folder) {
  std::string text;
  for (const char c : fs::absolute(folder).string())
    text += c == '%' ? std::string("%%") : std::string(1, c);
  return text + "/frame_%05d.png";
}

}  // namespace

std::optional<fs::path> find_executable(const std::string& program) {
  const char* const search_path = std::getenv("PATH");
  std::string_view remaining_path = search_path == nullptr ? "" : search_path;
  while (!remaining_path.empty()) {
    const std::size_t colon = std::min(remaining_path.find(':'), remaining_path.size());
    const fs::path file = fs::path(remaining_path.substr(0, colon)) / program;
    remaining_path.remove_prefix(std::min(colon + 1, remaining_path.size()));
    std::error_code ignored;
    if (fs::is_regular_file(file, ignored) && ::access(file.c_str(), X_OK) == 0) return file;
  }
  return std::nullopt;
}

std::vector<std::string> encoder_command(const std::string& ffmpeg, const FilmEncoding& encoding,
                                         const fs::path& film) {
  // yuv420p, because common players decode no other pixel format.
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
                                   frame_pattern(encoding.frames),
                                   "-frames:v",
                                   std::to_string(encoding.count),
                                   "-pix_fmt",
                                   "yuv420p"};
  // faststart puts the index first, so that a browser can play the film while it loads.
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
  constexpr std::string_view unquoted_characters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+./:%=,";
  std::string text;
  for (const std::string& argument : command) {
    if (!text.empty()) text += ' ';
    if (!argument.empty() && argument.find_first_not_of(unquoted_characters) == std::string::npos) {
      text += argument;
      continue;
    }
    text += '\'';
    for (const char c : argument) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    text += '\'';
  }
  return text;
}

void encode(const std::vector<std::string>& command, const std::function<void()>& waiting) {
  // One day, far beyond any film: the limit only ends an encoder that hangs.
  constexpr double max_s = 86400.0;
  compensation::ChildProcess child(command, {}, waiting);
  try {
    child.finish("", max_s);
  } catch (const compensation::ChildProcessError& error) {
    throw std::runtime_error(
        fmt::format("{}: {} {}", command.front(), error.what(), child.stderr_tail()));
  }
}

#if ABBE_RENDER

namespace {

std::string frame_name(std::size_t frame) { return fmt::format("frame_{:05d}.png", frame + 1); }

/// Returns true if the file name is that of a frame.
bool is_frame(const std::string& name) {
  return name.size() == std::string("frame_00001.png").size() && name.starts_with("frame_") &&
         name.ends_with(".png") &&
         std::all_of(name.begin() + 6, name.begin() + 11,
                     [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// Removes the files of an earlier film: a shorter or an interrupted film must not be mixed with
/// them. Other files in the folder are kept.
void remove_earlier_film(const ResultFolder& folder, const ResultFolder& frames) {
  for (const char* film : {"film.mp4", "film.webm"}) remove_file(folder / film);
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(frames.path(), ignored))
    if (is_frame(entry.path().filename().string()))
      names.push_back(entry.path().filename().string());
  for (const std::string& name : names) remove_file(frames / name);
}

/// Writes all frames. While a frame is drawn, other threads cut the stock of the next frame and
/// compress the previous one.
void write_frames(const ResultFolder& frames, ProgramFilm& program, const Progress& progress) {
  const std::size_t frame_count = program.frames();
  render::Film film(program.setting());
  const auto start_state = [&](std::size_t k) {
    return std::async(std::launch::async, [&program, k] { return program.state(k); });
  };
  std::future<render::FilmState> next_state = start_state(0);
  std::future<void> pending_write;
  for (std::size_t k = 0; k < frame_count; ++k) {
    const render::FilmState state = next_state.get();
    if (k + 1 < frame_count) next_state = start_state(k + 1);
    render::Pixels pixels = film.frame(state);
    if (pending_write.valid()) pending_write.get();
    pending_write = std::async(std::launch::async, [&frames, k, pixels = std::move(pixels)] {
      write_file(frames / frame_name(k), render::png_file(pixels));
    });
    if (progress) progress("frames", double(k + 1) / double(frame_count));
  }
  pending_write.get();
}

/// Encodes the frames to a temporary file, which is renamed at the end. An interrupt stops ffmpeg.
void write_encoded(const ResultFile& film, const std::string& ffmpeg, const FilmEncoding& encoding,
                   const Progress& progress) {
  if (progress) progress("encode", 0.0);
  try {
    write_file(film, [&](const fs::path& temporary) {
      encode(encoder_command(ffmpeg, encoding, temporary), stop_if_interrupted);
    });
  } catch (const OutputFailure&) {
    stop_if_interrupted();  // an interrupt is the cause of the failure
    throw;
  }
}

}  // namespace

FilmOutcome write_film(const ResultFolder& folder, const FilmSource& source,
                       const FilmRequest& request, const Progress& progress) {
  ProgramFilm program(source, request.plan, request.options);
  const ResultFolder frames = folder.inside("frames");
  remove_earlier_film(folder, frames);
  write_frames(frames, program, progress);
  FilmOutcome outcome{frames.path(), program.frames(), std::nullopt, ""};
  if (request.format == "none") return outcome;
  const FilmEncoding encoding{frames.path(), program.frames(), request.plan.fps};
  const ResultFile film = folder / ("film." + request.format);
  if (const auto ffmpeg = find_executable("ffmpeg")) {
    write_encoded(film, ffmpeg->string(), encoding, progress);
    outcome.film = film.path();
  } else {
    outcome.notice = "no ffmpeg on the PATH: the film is made of the frames by\n" +
                     shell_text(encoder_command("ffmpeg", encoding, film.path()));
  }
  return outcome;
}

#else

FilmOutcome write_film(const ResultFolder& folder, const FilmSource&, const FilmRequest&,
                       const Progress&) {
  throw BadInput(folder.path().string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "one without VTK");
}

#endif

}  // namespace abbe::sim
