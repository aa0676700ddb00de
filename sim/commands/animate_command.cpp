#include "sim/commands/animate_command.h"

#include <charconv>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/cut/cut.h"
#include "sim/cut/reach.h"
#include "sim/cut/stages.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/report/film_files.h"
#include "sim/report/pictures.h"
#include "sim/scene/case_name.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

constexpr std::size_t most_frames = 10'000;
constexpr int least_width = 320, least_height = 240, most_width = 7680, most_height = 4320;  // px

/// Options whose words are still to be read.
struct AnimateWords {
  std::string case_name = "uncompensated", magnify = "1", size = "1280x720", film = "mp4";
  double seconds = 10.0, fps = 25.0;
  std::optional<std::string> lines;
};

/// What the words say, before the scene is read.
struct AnimateOptions {
  std::optional<CaseDescription> compensator;
  std::optional<LineRange> lines;
  FilmOptions film;
};

/// A number that is all of a text.
template <typename Number>
std::optional<Number> parsed_number(std::string_view text) {
  Number value{};
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::pair<std::string_view, std::string_view> halves_of(std::string_view text, char separator) {
  const std::size_t at = text.find(separator);
  if (at == std::string_view::npos) return {text, {}};
  return {text.substr(0, at), text.substr(at + 1)};
}

/// "120:480", or a line alone.
LineRange lines_of(const std::string& text) {
  const std::string range = text.find(':') == std::string::npos ? text + ":" + text : text;
  const auto [from, to] = halves_of(range, ':');
  const auto first = parsed_number<int>(from), last = parsed_number<int>(to);
  if (first && last && *first >= 1 && *first <= *last) return {*first, *last};
  throw BadUsage(
      "--lines",
      "expected the first and the last line of the program as 120:480, or one line, seen " + text);
}

void read_size(const AnimateWords& words, FilmOptions& film) {
  const auto [across, upward] = halves_of(words.size, 'x');
  const auto width = parsed_number<int>(across), height = parsed_number<int>(upward);
  if (!width || !height || *width < least_width || *height < least_height || *width > most_width ||
      *height > most_height)
    throw BadUsage("--size",
                   fmt::format("expected pixels as 1280x720, from {}x{} to {}x{}, seen {}",
                               least_width, least_height, most_width, most_height, words.size));
  if (words.film != "none" && (*width % 2 != 0 || *height % 2 != 0))
    throw BadUsage("--size", "expected even numbers for " + words.film +
                                 ", which has colours for two pixels at a time (--film none takes "
                                 "any), seen " +
                                 words.size);
  film.width = *width;
  film.height = *height;
}

std::optional<double> magnification_of(const std::string& text) {
  constexpr double most = 1e6;
  if (text == "auto") return std::nullopt;
  const auto times = parsed_number<double>(text);
  if (times && *times >= 1.0 && *times <= most) return times;
  throw BadUsage("--magnify", "expected a factor from 1 to 1000000, or auto, seen " + text);
}

void check_length(const AnimateWords& words) {
  const auto is_between = [](double x, double least, double most) {
    return x >= least && x <= most;
  };
  if (!is_between(words.fps, 1.0, 120.0))
    throw BadUsage("--fps", fmt::format("expected 1 to 120 frames a second, seen {}", words.fps));
  if (!is_between(words.seconds, 1e-3, 1e5))
    throw BadUsage("--seconds", fmt::format("expected seconds above 0, seen {}", words.seconds));
  const double frames = std::round(words.seconds * words.fps);
  if (frames > double(most_frames))
    throw BadUsage("--seconds", fmt::format("expected at most {} frames, seen {} s at {} a second",
                                            most_frames, words.seconds, words.fps));
}

AnimateOptions options_of(const AnimateWords& words) {
  AnimateOptions options;
  check_length(words);
  if (words.case_name != "uncompensated") {
    check_case(words.case_name);
    options.compensator = parse_case(words.case_name);
  }
  if (words.lines) options.lines = lines_of(*words.lines);
  read_size(words, options.film);
  options.film.magnification = magnification_of(words.magnify);
  return options;
}

FilmStretch stretch_of(const program::Path& path, const AnimateOptions& options) {
  if (const auto stretch = stretch_of_lines(path, options.lines)) return *stretch;
  if (!options.lines)
    throw BadInput(path.file, 0, 0, "a program that moves", "one without a block");
  throw BadUsage("--lines", fmt::format("expected lines with blocks of {}, seen {}:{}", path.file,
                                        options.lines->first, options.lines->last));
}

/// The program as it was cut.
struct AnimatedCut {
  Commands commands;
  Process process;
  std::optional<cutting::Surface> surface;
};

AnimatedCut animated_cut(const Job& job, const AnimateOptions& options, const Progress& progress) {
  AnimatedCut made;
  made.commands =
      options.compensator ? compensate(job, *options.compensator, progress) : as_programmed(job);
  check_travel(job, made.commands);
  if (job.scene.cutting)
    made.process = cut_process(job, made.commands, progress);
  else
    made.surface = cut(job, made.commands, progress).surface;
  return made;
}

void print_film(const FilmWritten& written, bool json) {
  if (json) {
    nlohmann::ordered_json all = {{"frames", written.frames.string()}, {"count", written.count}};
    all["film"] = written.film ? nlohmann::ordered_json(written.film->string())
                               : nlohmann::ordered_json(nullptr);
    print("{}", Lines(json_text(all)));
  } else {
    print("{} frames in {}\n", written.count, written.frames.string());
    if (written.film) print("film in {}\n", written.film->string());
  }
  if (!written.notice.empty()) print(stderr, "abbe: {}\n", Lines(written.notice));
}

Exit animate(const Common& common, const AnimateWords& words) {
  const AnimateOptions options = options_of(words);
  Scene scene = read_trusted_scene(common.scene, overrides(common), common.permissions);
  trust(scene, words.case_name);
  if (!draws_pictures())
    throw BadInput(common.scene.string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                   "one without VTK");
  const ResultFolder folder(result_folder(common), writer_of(scene, common.permissions));
  const double frames = words.seconds * words.fps;
  const double pixels = double(options.film.width) * options.film.height;
  const auto rest = [&](const WorkSize& size) {
    return stages_of_cut(words.case_name, size, scene, options.compensator) +
           stages_of_film("film", size, frames, pixels);
  };
  const WorkSize expected = expected_size(scene);
  ProgressLine line(stages_of_preparing("prepare", expected) + rest(expected));
  line.begin("prepare");
  const Job job = placed(prepare(scene, to(line)));
  stretch_of(job.path, options);  // refused before anything is cut
  line.replan(rest(size_of(job)));
  line.begin(words.case_name);
  const AnimatedCut made = animated_cut(job, options, to(line));
  const FilmStretch stretch = stretch_of(path_of(job, made.commands), options);
  line.begin("film");
  const FilmWritten written = write_film(
      folder, {job, made.commands, made.process, made.surface ? &*made.surface : nullptr},
      {film_plan(stretch, words.seconds, words.fps), options.film, words.film}, to(line));
  print_film(written, common.json);
  print_warnings(job.warnings);
  return Exit::Ok;
}

}  // namespace

Command animate_command(Common& common) {
  const auto words = std::make_shared<AnimateWords>();
  return {
      "animate",
      "Film the machine while it cuts, frame by frame, without a display",
      {"abbe animate scenes/gantry_dome.toml --magnify auto --out out/film",
       "abbe animate scenes/gantry_force.toml --case perfect-iterated-ideal --seconds 20",
       "abbe animate scenes/stepped_shaft.toml --lines 10:40 --fps 30 --size 1920x1080"},
      scene_options(
          common,
          {result_folder_option(common),
           force_option(common),
           trust_option(common),
           {"--case", &words->case_name,
            "uncompensated, or belief-strategy-channel: what is filmed (uncompensated)"},
           {"--seconds", &words->seconds, "length of the film (10)", Type{"S"}},
           {"--fps", &words->fps, "frames a second (25)", Type{"F"}},
           {"--size", &words->size, "pixels (1280x720)", Type{"WxH"}},
           {"--magnify", &words->magnify,
            "errors of the tool and its path drawn so many times larger, or auto (1)", Type{"N"}},
           {"--lines", &words->lines, "these lines of the program alone (all); A alone is one line",
            Type{"A:B"}},
           {"--film", &words->film, "made of the frames by ffmpeg, where it is there (mp4)",
            OneOf{{"mp4", "webm", "none"}}}}),
      [words, &common] { return animate(common, *words); },
      "The film is the program from its first move to its last, or --lines of it, faster than "
      "the\nmachine. Frames stay in OUT/frames."};
}

}  // namespace abbe::sim
