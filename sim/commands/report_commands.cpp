#include "sim/commands/report_commands.h"

#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/commands/run_commands.h"
#include "sim/cut/cut.h"
#include "sim/cut/placement.h"
#include "sim/cut/run_estimate.h"
#include "sim/files/json_files.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/report/case_page.h"
#include "sim/report/evaluation_report.h"
#include "sim/report/film_files.h"
#include "sim/report/identification_page.h"
#include "sim/report/picture_files.h"
#include "sim/report/rendered_result.h"
#include "sim/scene/cases.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"
#include "sim/study/run_study.h"
#include "sim/study/study_results.h"

namespace abbe::sim {

namespace {

struct ReportArguments {
  std::vector<std::filesystem::path> compensators;
  std::filesystem::path file;
  std::string language = "en";
};

/// Prints the result of writing a page.
Exit print_report_file(const CommonOptions& common, const std::filesystem::path& file,
                       std::size_t bytes, const std::vector<std::string>& warnings) {
  if (common.json)
    print("{}",
          Lines(json_text({{"file", file.string()}, {"bytes", bytes}, {"warnings", warnings}})));
  else
    print("{}: {:.2f} MB\n", file.string(), double(bytes) * 1e-6);
  print_warnings(warnings);
  return Exit::Ok;
}

/// Computes a study, or the unfinished part of it, like `abbe study`, and writes its page.
Exit report_study(const CommonOptions& common, const ReportArguments& words) {
  study::StudyOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  if (words.file.empty()) options.report_language = words.language;
  const study::StudyResult result = study::run_study(common.scene, options, {});
  const std::filesystem::path beside = options.folder / "report.html";
  if (words.file.empty())
    return print_report_file(common, beside, std::filesystem::file_size(beside), result.warnings);
  const HtmlReport page = study::study_page(options.folder, words.language);
  write_file(result_file(words.file, {common.permissions, {common.scene}}), page.html);
  return print_report_file(common, words.file, page.html.size(), page.warnings);
}

/// Returns the page of a folder or file that a command wrote.
HtmlReport result_page(const std::filesystem::path& results, const ReportArguments& words) {
  if (std::filesystem::is_directory(results) && study::has_study(results))
    return study::study_page(results, words.language);
  if (std::filesystem::is_directory(results) && has_saved_cases(results))
    return saved_page(results, words.language);
  const bool is_evaluation = std::filesystem::is_directory(results);
  FiguresPage page = is_evaluation ? evaluate_page(results) : identify_page(results);
  page.language = words.language;
  page.command =
      is_evaluation ? "abbe evaluate READINGS --report" : "abbe identify READINGS --report";
  return {page_html(page), page.warnings};
}

/// Returns the files from which a page is made, which it must not replace.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& results) {
  if (!std::filesystem::is_directory(results)) return {results};
  std::vector<std::filesystem::path> files = saved_files(results);
  std::erase_if(files, [](const auto& file) { return file.extension() == ".html"; });
  return files;
}

/// Writes the page beside the results, unless another path is given.
Exit report_results(const CommonOptions& common, const ReportArguments& words) {
  // Saved results are fixed: an override would be ignored.
  if (!common.set.empty() || common.seed)
    throw BadUsage(common.set.empty() ? "--seed" : "--set",
                   "expected a scene or a study, seen results, which nothing changes");
  const std::filesystem::path& results = common.scene;
  const bool is_folder = std::filesystem::is_directory(results);
  const std::filesystem::path beside =
      is_folder ? results / "report.html"
                : std::filesystem::path(results).replace_extension(".html");
  const std::filesystem::path file = !words.file.empty()  ? words.file
                                     : common.out.empty() ? beside
                                                          : common.out / beside.filename();
  const HtmlReport page = result_page(results, words);
  write_file(result_file(file, {common.permissions, files_of(results)}), page.html);
  return print_report_file(common, file, page.html.size(), page.warnings);
}

/// Throws if a folder holds no results.
void check_report_source(const std::filesystem::path& folder) {
  if (study::has_study(folder) || has_saved_cases(folder) ||
      std::filesystem::exists(folder / "evaluation.json"))
    return;
  throw BadUsage("SCENE",
                 "expected a scene, a study, or what run, compare, study, identify or evaluate "
                 "left, seen the folder " +
                     folder.string() +
                     " without comparison.json, summary.json, budget.json or evaluation.json");
}

/// Writes a page of a scene, of a study, or of results: a folder or a .json file is a result.
Exit report(const CommonOptions& common, const ReportArguments& words) {
  if (std::filesystem::is_directory(common.scene)) check_report_source(common.scene);
  if (std::filesystem::is_directory(common.scene) || common.scene.extension() == ".json")
    return report_results(common, words);
  if (study::is_study(common.scene)) return report_study(common, words);
  RunOptions options = run_options(common, words.compensators, {});
  request_report(options, common, "report", words.language);
  const std::filesystem::path file =
      words.file.empty() ? result_folder(common) / "report.html" : words.file;
  const ReportOutcome reported = report(common.scene, options, file);
  print_report_file(common, file, reported.bytes, reported.warnings);
  // Limits and failures are printed on stderr; a failed plug-in outranks an exceeded limit.
  for (const std::string& limit : reported.exceeded_limits) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : reported.failed) print(stderr, "abbe: {}\n", Lines(failure));
  if (!reported.failed.empty()) return Exit::PlugIn;
  return reported.exceeded_limits.empty() ? Exit::Ok : Exit::LimitExceeded;
}

}  // namespace

Command report_command(CommonOptions& common) {
  const auto words = std::make_shared<ReportArguments>();
  return {
      "report",
      "Write a scene's cases, a study or other results as one HTML file: maps, machine, charts",
      {"abbe report scenes/gantry_dome.toml -o out/dome.html",
       "abbe report scenes/studies/gantry_dome_budget.toml --out out/budget",
       "abbe report out/budget --language zh", "abbe report out/belief.json -o out/belief.html",
       "abbe report scenes/gantry_dome.toml --set errors.scale=2 --language zh --out out/twice"},
      scene_options(common,
                    {{"--out", &common.out,
                      "the page, or folder for it (out/SCENE/report.html; of results beside them)"},
                     force_option(common),
                     memory_option(common),
                     trust_option(common),
                     compensator_option(words->compensators),
                     language_option(words->language)}),
      [words, &common] {
        // --out may name the page; the folder of the other files then stays the default.
        CommonOptions own = common;
        ReportArguments page = *words;
        if (own.out.extension() == ".html" && output_file(own.out, "report.html") == own.out)
          page.file = std::exchange(own.out, {});
        return report(own, page);
      }};
}

namespace {

/// Options with values that are still to be parsed.
struct RenderArguments {
  RenderOptions options;
  std::optional<std::string> view, range, bands, size, Nic, Nis;
  std::optional<std::int64_t> sections;
};

/// Returns numbers between separators; empty if the text is anything else.
std::optional<std::vector<double>> numbers_of(const std::string& text, char separator) {
  std::vector<double> values;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (true) {
    // from_chars does not accept a leading plus.
    if (at != end && *at == '+') ++at;
    double value = 0.0;
    const auto [next, fault] = std::from_chars(at, end, value);
    if (fault != std::errc() || !std::isfinite(value)) return std::nullopt;
    values.push_back(value);
    if (next == end) return values;
    if (*next != separator) return std::nullopt;
    at = next + 1;
  }
}

/// Parses "+x" ... "-z", "iso", or a direction "x,y,z".
Eigen::Vector3d direction_of(const std::string& text) {
  if (text == "iso") return {1.0, -1.0, 1.0};
  const std::string axes = "xyz";
  if (text.size() == 2 && (text[0] == '+' || text[0] == '-') &&
      axes.find(text[1]) != std::string::npos)
    return (text[0] == '+' ? 1.0 : -1.0) * Eigen::Vector3d::Unit(Eigen::Index(axes.find(text[1])));
  const auto v = numbers_of(text, ',');
  if (v && v->size() == 3 && Eigen::Vector3d((*v)[0], (*v)[1], (*v)[2]).norm() > 0.0)
    return {(*v)[0], (*v)[1], (*v)[2]};
  throw BadUsage("--view",
                 "expected +x, -x, +y, -y, +z, -z, iso or a direction as 1,-1,0.5, seen " + text);
}

/// Parses a symmetric tolerance or its two limits, um.
Tolerance parse_bands(const std::string& text) {
  const auto v = numbers_of(text, ',');
  if (v && v->size() == 1 && v->front() > 0.0)
    return {-v->front() * units::um, v->front() * units::um};
  if (v && v->size() == 2 && (*v)[0] < (*v)[1]) return {(*v)[0] * units::um, (*v)[1] * units::um};
  throw BadUsage("--bands", "expected micrometres, 5 or -2,8, the lower limit first, seen " + text);
}

std::array<int, 2> size_of(const std::string& text) {
  constexpr double least = 320.0, most = 16384.0;
  const auto v = numbers_of(text, 'x');
  const auto is_side = [](double px) { return px >= least && px <= most && px == std::round(px); };
  if (v && v->size() == 2 && is_side((*v)[0]) && is_side((*v)[1]))
    return {int((*v)[0]), int((*v)[1])};
  throw BadUsage("--size", "expected pixels as 1600x1200, each from 320 to 16384, seen " + text);
}

/// Parses a positive number with its unit in the error message.
double parse_positive(const char* option, const char* unit, const std::string& text) {
  const auto v = numbers_of(text, ',');
  if (v && v->size() == 1 && v->front() > 0.0) return v->front();
  throw BadUsage(option, fmt::format("expected {} above 0, seen {}", unit, text));
}

/// Returns the parsed options of `render`.
RenderOptions read(const RenderArguments& words) {
  RenderOptions options = words.options;
  if (words.Nic) options.texture.Nic = parse_positive("--nic", "millimetres", *words.Nic);
  if (words.Nis)
    options.texture.Nis = units::um * parse_positive("--nis", "micrometres", *words.Nis);
  if (words.sections) options.texture.sections = int(*words.sections);
  if (words.view) options.from = direction_of(*words.view);
  if (words.range) options.range_um = parse_positive("--range", "micrometres", *words.range);
  if (words.bands) options.bands = parse_bands(*words.bands);
  if (words.size) options.size = size_of(*words.size);
  return options;
}

void print_render(const RenderOutcome& rendered, bool json) {
  if (json) {
    nlohmann::ordered_json all = {{"picture", rendered.picture.string()}};
    for (const std::filesystem::path& file : rendered.files) all["files"].push_back(file.string());
    if (rendered.texture) all["profile"] = to_json(*rendered.texture);
    print("{}", Lines(json_text(all)));
  } else {
    if (rendered.texture) print("{}\n", Lines(to_text(*rendered.texture)));
    print("picture in {}\n", rendered.picture.string());
    for (const std::filesystem::path& file : rendered.files) print("file in {}\n", file.string());
  }
  if (rendered.texture) print_warnings(rendered.texture->warnings);
}

}  // namespace

Command render_command(CommonOptions& common) {
  const auto words = std::make_shared<RenderArguments>();
  RenderOptions& options = words->options;
  return {
      "render",
      "Draw a finished result again, or a difference of two",
      {"abbe render out/dome/uncompensated --line radius",
       "abbe render out/twice --minus out/dome/error_free --out out/difference",
       "abbe render out/dome/uncompensated --bands -2,8 --view +z --format pdf"},
      {{"RESULT", &options.result, "residual.vtp or a folder that has one"},
       {"--minus", &options.minus, "another result, taken away vertex by vertex"},
       {"--line", &options.line,
        "profile along x, y or radius instead of the map, with its parameters by ISO 21920",
        OneOf{{"x", "y", "radius"}}},
       {"--nic", &words->Nic,
        "nesting index Nic of that line, between waviness and roughness (the part's "
        "form_cutoff_mm)",
        TypeName{"MM"}, RequiresOption{"--line"}},
       {"--nis", &words->Nis,
        "nesting index Nis of that line, below which all is smoothed (that of the setting class)",
        TypeName{"UM"}, RequiresOption{"--line"}},
       {"--sections", &words->sections,
        "section lengths of Nic over which roughness is evaluated (5)", Between{1, 1000},
        RequiresOption{"--line"}},
       {"--view", &words->view, "where the eye is: +x ... -z, iso or a direction 1,-1,0.5",
        TypeName{"FROM"}},
       {"--range", &words->range, "the colour scale runs from -UM to UM micrometres",
        TypeName{"UM"}},
       {"--bands", &words->bands,
        "colours in, over and under a tolerance in micrometres: 5, or -2,8", TypeName{"UM"}},
       {"--colours", &options.colours,
        "of the map (those of the tolerance with --bands, else diverging)",
        OneOf{{"diverging", "cividis", "tolerance"}}},
       {"--isolines", &options.isolines, "lines of equal deviation at the ticks of the scale"},
       {"--size", &words->size, "pixels (1600x1200)", TypeName{"WxH"}},
       {"--format", &options.format,
        "of the picture; in svg and pdf the map itself is a raster, all else sharp",
        OneOf{{"png", "svg", "pdf"}}},
       {"--out", &options.out, "folder for the pictures (that of RESULT)"},
       json_option(common),
       force_option(common),
       threads_option(common, "most threads to use")},
      [words, &common] {
        words->options.permissions = common.permissions;
        print_render(render_result(read(*words)), common.json);
        return Exit::Ok;
      }};
}

namespace {

constexpr std::size_t max_frames = 10'000;
constexpr int min_width = 320, min_height = 240, max_width = 7680, max_height = 4320;  // px

/// Options with values that are still to be parsed.
struct AnimateArguments {
  std::string case_name = "uncompensated", magnify = "1", size = "1280x720", film = "mp4";
  double seconds = 10.0, fps = 25.0;
  std::optional<std::string> lines;
};

/// Parsed options, before the scene is read.
struct AnimateOptions {
  std::optional<CaseDescription> compensator;
  std::optional<LineRange> lines;
  FilmOptions film;
};

/// Returns the number that is the whole text; empty otherwise.
template <typename Number>
std::optional<Number> parsed_number(std::string_view text) {
  Number value{};
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Returns the parts of a text before and after a separator; the second is empty without one.
std::pair<std::string_view, std::string_view> halves_of(std::string_view text, char separator) {
  const std::size_t at = text.find(separator);
  if (at == std::string_view::npos) return {text, {}};
  return {text.substr(0, at), text.substr(at + 1)};
}

/// Parses "120:480", or a single line.
LineRange lines_of(const std::string& text) {
  const std::string range = text.find(':') == std::string::npos ? text + ":" + text : text;
  const auto [from, to] = halves_of(range, ':');
  const auto first = parsed_number<int>(from), last = parsed_number<int>(to);
  if (first && last && *first >= 1 && *first <= *last) return {*first, *last};
  throw BadUsage(
      "--lines",
      "expected the first and the last line of the program as 120:480, or one line, seen " + text);
}

void read_size(const AnimateArguments& words, FilmOptions& film) {
  const auto [across, upward] = halves_of(words.size, 'x');
  const auto width = parsed_number<int>(across), height = parsed_number<int>(upward);
  if (!width || !height || *width < min_width || *height < min_height || *width > max_width ||
      *height > max_height)
    throw BadUsage("--size",
                   fmt::format("expected pixels as 1280x720, from {}x{} to {}x{}, seen {}",
                               min_width, min_height, max_width, max_height, words.size));
  // yuv420p stores one colour for two by two pixels.
  if (words.film != "none" && (*width % 2 != 0 || *height % 2 != 0))
    throw BadUsage("--size", "expected even numbers for " + words.film +
                                 ", which has colours for two pixels at a time (--film none takes "
                                 "any), seen " +
                                 words.size);
  film.width = *width;
  film.height = *height;
}

/// Parses a magnification; empty for "auto".
std::optional<double> parse_magnification(const std::string& text) {
  constexpr double most = 1e6;
  if (text == "auto") return std::nullopt;
  const auto times = parsed_number<double>(text);
  if (times && *times >= 1.0 && *times <= most) return times;
  throw BadUsage("--magnify", "expected a factor from 1 to 1000000, or auto, seen " + text);
}

/// Checks length and frame rate: at most 10 000 frames, which are kept as files.
void check_length(const AnimateArguments& words) {
  const auto is_between = [](double x, double least, double most) {
    return x >= least && x <= most;
  };
  if (!is_between(words.fps, 1.0, 120.0))
    throw BadUsage("--fps", fmt::format("expected 1 to 120 frames a second, seen {}", words.fps));
  if (!is_between(words.seconds, 1e-3, 1e5))
    throw BadUsage("--seconds", fmt::format("expected seconds above 0, seen {}", words.seconds));
  const double frames = std::round(words.seconds * words.fps);
  if (frames > double(max_frames))
    throw BadUsage("--seconds", fmt::format("expected at most {} frames, seen {} s at {} a second",
                                            max_frames, words.seconds, words.fps));
}

AnimateOptions options_of(const AnimateArguments& words) {
  AnimateOptions options;
  check_length(words);
  if (words.case_name != "uncompensated") {
    check_case(words.case_name);
    options.compensator = parse_case(words.case_name);
  }
  if (words.lines) options.lines = lines_of(*words.lines);
  read_size(words, options.film);
  options.film.magnification = parse_magnification(words.magnify);
  return options;
}

/// Returns the interval to film; an error if the program has no block there.
FilmInterval stretch_of(const program::Path& path, const AnimateOptions& options) {
  if (const auto stretch = interval_of_lines(path, options.lines)) return *stretch;
  if (!options.lines)
    throw BadInput(path.file, 0, 0, "a program that moves", "one without a block");
  throw BadUsage("--lines", fmt::format("expected lines with blocks of {}, seen {}:{}", path.file,
                                        options.lines->first, options.lines->last));
}

/// The program as it was cut.
struct FilmedProgram {
  Commands commands;
  Process process;
  std::optional<cutting::Surface> surface;
};

/// Cuts the program: with [cutting] its process is filmed, otherwise the surface.
FilmedProgram cut_for_film(const Job& job, const AnimateOptions& options,
                           const Progress& progress) {
  FilmedProgram made;
  made.commands = options.compensator ? compensate(job, *options.compensator, progress)
                                      : uncompensated_commands(job);
  check_travel(job, made.commands);
  if (job.scene.cutting)
    made.process = cut_process(job, made.commands, progress);
  else
    made.surface = cut(job, made.commands, progress).surface;
  return made;
}

void print_film(const FilmOutcome& written, bool json) {
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

/// Films a case. Everything that can be wrong is checked before the cut.
Exit animate(const CommonOptions& common, const AnimateArguments& words) {
  const AnimateOptions options = options_of(words);
  Scene scene = read_trusted_scene(common.scene, overrides(common), common.permissions);
  trust(scene, words.case_name);
  if (!can_draw_pictures())
    throw BadInput(common.scene.string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                   "one without VTK");
  const ResultFolder folder(result_folder(common), make_writer(scene, common.permissions));
  const double frames = words.seconds * words.fps;
  const double pixels = double(options.film.width) * options.film.height;
  const auto rest = [&](const WorkSize& size) {
    return cut_stages(words.case_name, size, scene, options.compensator) +
           film_stages("film", size, frames, pixels);
  };
  const WorkSize expected = expected_size(scene);
  ProgressLine line(scene_preparation_stages("prepare", expected) + rest(expected));
  line.begin("prepare");
  const Job job = placed(prepare(scene, to(line)));
  stretch_of(job.path, options);  // an input error is reported before anything is cut
  line.replan(rest(size_of(job)));
  line.begin(words.case_name);
  const FilmedProgram made = cut_for_film(job, options, to(line));
  const FilmInterval stretch = stretch_of(path_of(job, made.commands), options);
  line.begin("film");
  const FilmOutcome written = write_film(
      folder, {job, made.commands, made.process, made.surface ? &*made.surface : nullptr},
      {film_plan(stretch, words.seconds, words.fps), options.film, words.film}, to(line));
  print_film(written, common.json);
  print_warnings(job.warnings);
  return Exit::Ok;
}

}  // namespace

Command animate_command(CommonOptions& common) {
  const auto words = std::make_shared<AnimateArguments>();
  return {
      "animate",
      "Film the machine while it cuts, frame by frame, without a display",
      {"abbe animate scenes/gantry_dome.toml --magnify auto --out out/film",
       "abbe animate scenes/gantry_force.toml --case perfect-iterated-ideal --seconds 20",
       "abbe animate scenes/stepped_shaft.toml --lines 10:40 --fps 30 --size 1920x1080"},
      scene_options(
          common, {result_folder_option(common),
                   force_option(common),
                   trust_option(common),
                   {"--case", &words->case_name,
                    "uncompensated, or belief-strategy-channel: what is filmed (uncompensated)"},
                   {"--seconds", &words->seconds, "length of the film (10)", TypeName{"S"}},
                   {"--fps", &words->fps, "frames a second (25)", TypeName{"F"}},
                   {"--size", &words->size, "pixels (1280x720)", TypeName{"WxH"}},
                   {"--magnify", &words->magnify,
                    "errors of the tool and its path drawn so many times larger, or auto (1)",
                    TypeName{"N"}},
                   {"--lines", &words->lines,
                    "these lines of the program alone (all); A alone is one line", TypeName{"A:B"}},
                   {"--film", &words->film, "made of the frames by ffmpeg, where it is there (mp4)",
                    OneOf{{"mp4", "webm", "none"}}}}),
      [words, &common] { return animate(common, *words); },
      "The film is the program from its first move to its last, or --lines of it, faster than "
      "the\nmachine. Frames stay in OUT/frames."};
}

}  // namespace abbe::sim
