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
#include "sim/report/identification_page.h"
#include "sim/report/picture_files.h"
#include "sim/report/rendered_result.h"
#include "sim/report/result_files.h"
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

/// Prints the file, its size and the warnings of a page.
Exit print_report_file(const CommonOptions& common, const std::filesystem::path& file,
                       std::size_t bytes, const std::vector<std::string>& warnings) {
  if (common.json)
    print("{}", MultilineText(json_text(
                    {{"file", file.string()}, {"bytes", bytes}, {"warnings", warnings}})));
  else
    print("{}: {:.2f} MB\n", file.string(), double(bytes) * 1e-6);
  print_warnings(warnings);
  return Exit::Ok;
}

/// Returns the page of results that a command wrote, in a folder or a file.
HtmlReport result_page(const std::filesystem::path& results, const std::string& language) {
  const bool is_folder = std::filesystem::is_directory(results);
  const bool is_study = is_folder && study::has_study(results);
  if (is_folder && !is_study && has_saved_cases(results))
    return saved_results_page(results, language);
  FiguresPage page = is_study    ? study::saved_study_page(results)
                     : is_folder ? read_page(results / "page.json", {results / "evaluation.json"})
                                 : saved_identification_page(results);
  page.language = language;
  if (!is_study)
    page.warnings.push_back(
        "the page does not hold the files of readings, which the command on it needs; with "
        "--report the command that reads them writes a page that does");
  return {page_html(page), page.warnings};
}

/// Computes a study, or its unfinished part, as `abbe study` does, and writes its page.
Exit report_study(const CommonOptions& common, const ReportArguments& arguments) {
  study::StudyOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  study::run_study(common.scene, options, {});
  const std::filesystem::path file =
      arguments.file.empty() ? options.folder / "report.html" : arguments.file;
  const HtmlReport page = result_page(options.folder, arguments.language);
  write_file(result_file(file, {common.permissions, {common.scene}}), page.html);
  return print_report_file(common, file, page.html.size(), page.warnings);
}

/// Returns the input files of a page, which it must not replace.
std::vector<std::filesystem::path> page_inputs(const std::filesystem::path& results) {
  if (!std::filesystem::is_directory(results)) return {results};
  std::vector<std::filesystem::path> files = files_below(results);
  std::erase_if(files, [](const auto& file) { return file.extension() == ".html"; });
  return files;
}

/// Writes the page of results, by default beside them.
Exit report_results(const CommonOptions& common, const ReportArguments& arguments) {
  // An override cannot change saved results.
  if (!common.set.empty() || common.seed)
    throw BadUsage(common.set.empty() ? "--seed" : "--set",
                   "expected a scene or a study, seen results, which cannot be changed");
  const std::filesystem::path& results = common.scene;
  const bool is_folder = std::filesystem::is_directory(results);
  const std::filesystem::path default_file =
      is_folder ? results / "report.html"
                : std::filesystem::path(results).replace_extension(".html");
  const std::filesystem::path file = !arguments.file.empty() ? arguments.file
                                     : common.out.empty()    ? default_file
                                                             : common.out / default_file.filename();
  const HtmlReport page = result_page(results, arguments.language);
  write_file(result_file(file, {common.permissions, page_inputs(results)}), page.html);
  return print_report_file(common, file, page.html.size(), page.warnings);
}

/// Throws BadUsage if a folder holds no results.
void check_report_source(const std::filesystem::path& folder) {
  if (study::has_study(folder) || has_saved_cases(folder) ||
      std::filesystem::exists(folder / "evaluation.json"))
    return;
  throw BadUsage("SCENE",
                 "expected a scene, a study, or results of run, compare, study, identify or "
                 "evaluate, seen the folder " +
                     folder.string() +
                     " without comparison.json, summary.json, budget.json or evaluation.json");
}

/// Writes a page of a scene, of a study, or of results. A folder or a .json file is a result.
Exit report(const CommonOptions& common, const ReportArguments& arguments) {
  if (std::filesystem::is_directory(common.scene)) check_report_source(common.scene);
  if (std::filesystem::is_directory(common.scene) || common.scene.extension() == ".json")
    return report_results(common, arguments);
  if (study::is_study(common.scene)) return report_study(common, arguments);
  RunOptions options = run_options(common, arguments.compensators, {});
  request_report(options, common, "report", arguments.language);
  const std::filesystem::path file =
      arguments.file.empty() ? result_folder(common) / "report.html" : arguments.file;
  const ReportOutcome outcome = report(common.scene, options, file);
  print_report_file(common, file, outcome.bytes, outcome.warnings);
  return print_limits_and_failures(outcome.exceeded_limits, outcome.failed);
}

}  // namespace

Command report_command(CommonOptions& common) {
  const auto arguments = std::make_shared<ReportArguments>();
  return {
      "report",
      "Write the cases of a scene, a study or other results as one HTML file: maps, machine, "
      "charts",
      {"abbe report scenes/gantry_dome.toml -o out/dome.html",
       "abbe report scenes/studies/gantry_dome_budget.toml --out out/budget",
       "abbe report out/budget --language zh", "abbe report out/belief.json -o out/belief.html",
       "abbe report scenes/gantry_dome.toml --set errors.scale=2 --language zh --out out/twice"},
      scene_options(
          common,
          {{"--out", &common.out,
            "HTML file, or folder for it (out/SCENE/report.html; for results, next to them)"},
           force_option(common),
           memory_option(common),
           trust_option(common),
           compensator_option(arguments->compensators),
           language_option(arguments->language)}),
      [arguments, &common] {
        // If --out names the page, the other files are written into the default folder.
        CommonOptions report_options = common;
        ReportArguments report_arguments = *arguments;
        if (report_options.out.extension() == ".html" &&
            output_file(report_options.out, "report.html") == report_options.out)
          report_arguments.file = std::exchange(report_options.out, {});
        return report(report_options, report_arguments);
      }};
}

namespace {

/// Arguments of `abbe render`; the texts are not parsed yet.
struct RenderArguments {
  RenderOptions options;
  std::optional<std::string> view, range, bands, size, Nic, Nis;
  std::optional<std::int64_t> sections;
};

/// Parses numbers between separators. Returns nothing for any other text.
std::optional<std::vector<double>> parse_numbers(const std::string& text, char separator) {
  std::vector<double> values;
  const char* cursor = text.data();
  const char* const end = cursor + text.size();
  while (true) {
    // from_chars does not accept a leading plus.
    if (cursor != end && *cursor == '+') ++cursor;
    double value = 0.0;
    const auto [next, error] = std::from_chars(cursor, end, value);
    if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
    values.push_back(value);
    if (next == end) return values;
    if (*next != separator) return std::nullopt;
    cursor = next + 1;
  }
}

/// Parses a direction of view: "+x" to "-z", "iso", or components "x,y,z".
Eigen::Vector3d parse_direction(const std::string& text) {
  if (text == "iso") return {1.0, -1.0, 1.0};
  const std::string axes = "xyz";
  if (text.size() == 2 && (text[0] == '+' || text[0] == '-') &&
      axes.find(text[1]) != std::string::npos)
    return (text[0] == '+' ? 1.0 : -1.0) * Eigen::Vector3d::Unit(Eigen::Index(axes.find(text[1])));
  const auto v = parse_numbers(text, ',');
  if (v && v->size() == 3 && Eigen::Vector3d((*v)[0], (*v)[1], (*v)[2]).norm() > 0.0)
    return {(*v)[0], (*v)[1], (*v)[2]};
  throw BadUsage(
      "--view",
      "expected +x, -x, +y, -y, +z, -z, iso or a direction such as 1,-1,0.5, seen " + text);
}

/// Parses a symmetric tolerance or its two limits, um.
Tolerance parse_bands(const std::string& text) {
  const auto v = parse_numbers(text, ',');
  if (v && v->size() == 1 && v->front() > 0.0)
    return {-v->front() * units::um, v->front() * units::um};
  if (v && v->size() == 2 && (*v)[0] < (*v)[1]) return {(*v)[0] * units::um, (*v)[1] * units::um};
  throw BadUsage("--bands",
                 "expected micrometres such as 5 or -2,8 (lower limit first), seen " + text);
}

/// Parses width and height in pixels, such as "1600x1200".
std::array<int, 2> parse_size(const std::string& text) {
  constexpr double min_px = 320.0, max_px = 16384.0;
  const auto v = parse_numbers(text, 'x');
  const auto is_side = [](double px) {
    return px >= min_px && px <= max_px && px == std::round(px);
  };
  if (v && v->size() == 2 && is_side((*v)[0]) && is_side((*v)[1]))
    return {int((*v)[0]), int((*v)[1])};
  throw BadUsage("--size",
                 "expected pixels such as 1600x1200, each from 320 to 16384, seen " + text);
}

/// Parses a positive number. `option` and `unit` are for the error message.
double parse_positive(const char* option, const char* unit, const std::string& text) {
  const auto v = parse_numbers(text, ',');
  if (v && v->size() == 1 && v->front() > 0.0) return v->front();
  throw BadUsage(option, fmt::format("expected {} above 0, seen {}", unit, text));
}

/// Returns the parsed options of `render`.
RenderOptions parse_options(const RenderArguments& arguments) {
  RenderOptions options = arguments.options;
  if (arguments.Nic) options.texture.Nic = parse_positive("--nic", "millimetres", *arguments.Nic);
  if (arguments.Nis)
    options.texture.Nis = units::um * parse_positive("--nis", "micrometres", *arguments.Nis);
  if (arguments.sections) options.texture.sections = int(*arguments.sections);
  if (arguments.view) options.from = parse_direction(*arguments.view);
  if (arguments.range)
    options.range_um = parse_positive("--range", "micrometres", *arguments.range);
  if (arguments.bands) options.bands = parse_bands(*arguments.bands);
  if (arguments.size) options.size = parse_size(*arguments.size);
  return options;
}

void print_render(const RenderOutcome& outcome, bool json) {
  if (json) {
    nlohmann::ordered_json json_object = {{"picture", outcome.picture.string()}};
    for (const std::filesystem::path& file : outcome.files)
      json_object["files"].push_back(file.string());
    if (outcome.texture) json_object["profile"] = to_json(*outcome.texture);
    print("{}", MultilineText(json_text(json_object)));
  } else {
    if (outcome.texture) print("{}\n", MultilineText(to_text(*outcome.texture)));
    print("picture in {}\n", outcome.picture.string());
    for (const std::filesystem::path& file : outcome.files) print("file in {}\n", file.string());
  }
  if (outcome.texture) print_warnings(outcome.texture->warnings);
}

}  // namespace

Command render_command(CommonOptions& common) {
  const auto arguments = std::make_shared<RenderArguments>();
  RenderOptions& options = arguments->options;
  return {
      "render",
      "Redraw a finished result, or draw the difference of two",
      {"abbe render out/dome/uncompensated --line radius",
       "abbe render out/twice --minus out/dome/error_free --out out/difference",
       "abbe render out/dome/uncompensated --bands -2,8 --view +z --format pdf"},
      {{"RESULT", &options.result, "residual.vtp, or a folder that contains one"},
       {"--minus", &options.minus, "result to subtract vertex by vertex"},
       {"--line", &options.line,
        "profile along x, y or radius instead of the map, with its parameters to ISO 21920",
        OneOf{{"x", "y", "radius"}}},
       {"--nic", &arguments->Nic,
        "nesting index Nic of that profile, between waviness and roughness (form_cutoff_mm of the "
        "part)",
        TypeName{"MM"}, RequiresOption{"--line"}},
       {"--nis", &arguments->Nis,
        "nesting index Nis of that profile, which removes shorter wavelengths (that of the setting "
        "class)",
        TypeName{"UM"}, RequiresOption{"--line"}},
       {"--sections", &arguments->sections, "number of section lengths Nic for roughness (5)",
        NumberRange{1, 1000}, RequiresOption{"--line"}},
       {"--view", &arguments->view, "view from this direction: +x ... -z, iso or a vector 1,-1,0.5",
        TypeName{"FROM"}},
       {"--range", &arguments->range, "the colour scale runs from -UM to UM micrometres",
        TypeName{"UM"}},
       {"--bands", &arguments->bands,
        "colour by tolerance in micrometres (within, above, below): 5, or -2,8", TypeName{"UM"}},
       {"--colours", &options.colours, "colour map (tolerance with --bands, else diverging)",
        OneOf{{"diverging", "cividis", "tolerance"}}},
       {"--isolines", &options.isolines, "lines of equal deviation at the ticks of the scale"},
       {"--size", &arguments->size, "pixels (1600x1200)", TypeName{"WxH"}},
       {"--format", &options.format,
        "picture format; in svg and pdf only the map itself is a raster image",
        OneOf{{"png", "svg", "pdf"}}},
       {"--out", &options.out, "folder for the pictures (that of RESULT)"},
       json_option(common),
       force_option(common),
       threads_option(common, "maximum number of threads")},
      [arguments, &common] {
        arguments->options.permissions = common.permissions;
        print_render(render_result(parse_options(*arguments)), common.json);
        return Exit::Ok;
      }};
}

namespace {

constexpr std::size_t max_frames = 10'000;
constexpr int min_width = 320, min_height = 240, max_width = 7680, max_height = 4320;  // px

/// Arguments of `abbe animate`; the texts are not parsed yet.
struct AnimateArguments {
  std::string case_name = "uncompensated", magnify = "1", size = "1280x720", film = "mp4";
  double seconds = 10.0, fps = 25.0;
  std::optional<std::string> lines;
};

/// Parsed arguments of `abbe animate`.
struct AnimateOptions {
  std::optional<CaseDescription> compensator;
  std::optional<LineRange> lines;
  FilmOptions film;
};

/// Parses a text that consists of one number. Returns nothing for any other text.
template <typename Number>
std::optional<Number> parse_number(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Returns the parts of a text before and after a separator. Without one the second part is empty.
std::pair<std::string_view, std::string_view> split_at(std::string_view text, char separator) {
  const std::size_t position = text.find(separator);
  if (position == std::string_view::npos) return {text, {}};
  return {text.substr(0, position), text.substr(position + 1)};
}

/// Parses a range of lines such as "120:480", or a single line.
LineRange parse_lines(const std::string& text) {
  const std::string range = text.find(':') == std::string::npos ? text + ":" + text : text;
  const auto [from, to] = split_at(range, ':');
  const auto first = parse_number<int>(from), last = parse_number<int>(to);
  if (first && last && *first >= 1 && *first <= *last) return {*first, *last};
  throw BadUsage(
      "--lines",
      "expected first and last line of the program such as 120:480, or one line, seen " + text);
}

void parse_film_size(const AnimateArguments& arguments, FilmOptions& film) {
  const auto [width_text, height_text] = split_at(arguments.size, 'x');
  const auto width = parse_number<int>(width_text), height = parse_number<int>(height_text);
  if (!width || !height || *width < min_width || *height < min_height || *width > max_width ||
      *height > max_height)
    throw BadUsage("--size",
                   fmt::format("expected pixels such as 1280x720, from {}x{} to {}x{}, seen {}",
                               min_width, min_height, max_width, max_height, arguments.size));
  // yuv420p stores one colour for two by two pixels.
  if (arguments.film != "none" && (*width % 2 != 0 || *height % 2 != 0))
    throw BadUsage(
        "--size",
        "expected even numbers for " + arguments.film +
            ", which stores one colour for 2 x 2 pixels (--film none accepts any size), seen " +
            arguments.size);
  film.width = *width;
  film.height = *height;
}

/// Parses a magnification. Returns nothing for "auto".
std::optional<double> parse_magnification(const std::string& text) {
  constexpr double max_magnification = 1e6;
  if (text == "auto") return std::nullopt;
  const auto factor = parse_number<double>(text);
  if (factor && *factor >= 1.0 && *factor <= max_magnification) return factor;
  throw BadUsage("--magnify", "expected a factor from 1 to 1000000, or auto, seen " + text);
}

/// Checks duration and frame rate. At most 10 000 frames are allowed, because they are kept as
/// files.
void check_length(const AnimateArguments& arguments) {
  const auto is_between = [](double x, double min, double max) { return x >= min && x <= max; };
  if (!is_between(arguments.fps, 1.0, 120.0))
    throw BadUsage("--fps",
                   fmt::format("expected 1 to 120 frames per second, seen {}", arguments.fps));
  if (!is_between(arguments.seconds, 1e-3, 1e5))
    throw BadUsage("--seconds",
                   fmt::format("expected 0.001 to 100000 seconds, seen {}", arguments.seconds));
  const double frames = std::round(arguments.seconds * arguments.fps);
  if (frames > double(max_frames))
    throw BadUsage("--seconds",
                   fmt::format("expected at most {} frames, seen {} s at {} frames per second",
                               max_frames, arguments.seconds, arguments.fps));
}

AnimateOptions parse_animate_options(const AnimateArguments& arguments) {
  AnimateOptions options;
  check_length(arguments);
  if (arguments.case_name != "uncompensated") {
    check_case(arguments.case_name);
    options.compensator = parse_case(arguments.case_name);
  }
  if (arguments.lines) options.lines = parse_lines(*arguments.lines);
  parse_film_size(arguments, options.film);
  options.film.magnification = parse_magnification(arguments.magnify);
  return options;
}

/// Returns the interval to film. Throws if the program has no block in it.
FilmInterval film_interval(const program::Path& path, const AnimateOptions& options) {
  if (const auto interval = line_time_interval(path, options.lines)) return *interval;
  if (!options.lines)
    throw BadInput(path.file, 0, 0, "a program with motion", "a program without motion blocks");
  throw BadUsage("--lines", fmt::format("expected lines with motion blocks of {}, seen {}:{}",
                                        path.file, options.lines->first, options.lines->last));
}

/// The commands of a program, and its process or its surface.
struct CutProgram {
  Commands commands;
  Process process;
  std::optional<cutting::Surface> surface;
};

/// Cuts the program. The film shows its process if the scene has [cutting], otherwise the surface.
CutProgram cut_for_film(const Job& job, const AnimateOptions& options, const Progress& progress) {
  CutProgram filmed;
  filmed.commands = options.compensator ? compensate(job, *options.compensator, progress)
                                        : uncompensated_commands(job);
  check_travel(job, filmed.commands);
  if (job.scene.cutting)
    filmed.process = cut_process(job, filmed.commands, progress);
  else
    filmed.surface = cut(job, filmed.commands, progress).surface;
  return filmed;
}

void print_film(const FilmOutcome& outcome, bool json) {
  if (json) {
    nlohmann::ordered_json json_object = {{"frames", outcome.frames.string()},
                                          {"count", outcome.count}};
    json_object["film"] = outcome.film ? nlohmann::ordered_json(outcome.film->string())
                                       : nlohmann::ordered_json(nullptr);
    print("{}", MultilineText(json_text(json_object)));
  } else {
    print("{} frames in {}\n", outcome.count, outcome.frames.string());
    if (outcome.film) print("film in {}\n", outcome.film->string());
  }
  if (!outcome.notice.empty()) print(stderr, "abbe: {}\n", MultilineText(outcome.notice));
}

/// Films a case. All input errors are reported before the cut.
Exit animate(const CommonOptions& common, const AnimateArguments& arguments) {
  const AnimateOptions options = parse_animate_options(arguments);
  Scene scene = read_trusted_scene(common.scene, overrides(common), common.permissions);
  trust(scene, arguments.case_name);
  if (!can_draw_pictures())
    throw BadInput(common.scene.string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                   "a program built without VTK");
  const ResultFolder folder(result_folder(common), make_writer(scene, common.permissions));
  const double frames = arguments.seconds * arguments.fps;
  const double pixels = double(options.film.width) * options.film.height;
  const auto remaining_stages = [&](const WorkSize& size) {
    return cut_stages(arguments.case_name, size, scene, options.compensator) +
           film_stages("film", size, frames, pixels);
  };
  const WorkSize expected = expected_size(scene);
  ProgressLine progress_line(scene_preparation_stages("prepare", expected) +
                             remaining_stages(expected));
  progress_line.begin("prepare");
  const Job job = check_placement(prepare(scene, progress_function(progress_line)));
  film_interval(job.path, options);  // reports input errors before anything is cut
  progress_line.replan(remaining_stages(work_size(job)));
  progress_line.begin(arguments.case_name);
  const CutProgram filmed = cut_for_film(job, options, progress_function(progress_line));
  const FilmInterval interval = film_interval(path_of(job, filmed.commands), options);
  progress_line.begin("film");
  const FilmOutcome outcome = write_film(
      folder, {job, filmed.commands, filmed.process, filmed.surface ? &*filmed.surface : nullptr},
      {film_plan(interval, arguments.seconds, arguments.fps), options.film, arguments.film},
      progress_function(progress_line));
  print_film(outcome, common.json);
  print_warnings(job.warnings);
  return Exit::Ok;
}

}  // namespace

Command animate_command(CommonOptions& common) {
  const auto arguments = std::make_shared<AnimateArguments>();
  return {"animate",
          "Make a film of the machine cutting; needs no display",
          {"abbe animate scenes/gantry_dome.toml --magnify auto --out out/film",
           "abbe animate scenes/gantry_force.toml --case perfect-iterated-ideal --seconds 20",
           "abbe animate scenes/stepped_shaft.toml --lines 10:40 --fps 30 --size 1920x1080"},
          scene_options(
              common,
              {result_folder_option(common),
               force_option(common),
               trust_option(common),
               {"--case", &arguments->case_name,
                "case to film: uncompensated, or belief-strategy-channel (uncompensated)"},
               {"--seconds", &arguments->seconds, "duration of the film (10)", TypeName{"S"}},
               {"--fps", &arguments->fps, "frames per second (25)", TypeName{"F"}},
               {"--size", &arguments->size, "pixels (1280x720)", TypeName{"WxH"}},
               {"--magnify", &arguments->magnify,
                "magnification of the errors of the tool and its path, or auto (1)", TypeName{"N"}},
               {"--lines", &arguments->lines,
                "lines of the program to film (all); A alone is one line", TypeName{"A:B"}},
               {"--film", &arguments->film,
                "film format; encoded from the frames by ffmpeg if installed (mp4)",
                OneOf{{"mp4", "webm", "none"}}}}),
          [arguments, &common] { return animate(common, *arguments); },
          "The film shows the program from its first move to its last, or --lines of it, faster "
          "than real\ntime. Frames are kept in OUT/frames."};
}

}  // namespace abbe::sim
