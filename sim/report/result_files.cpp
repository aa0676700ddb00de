#include "sim/report/result_files.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <future>
#include <map>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/compensation/child_process.h"
#include "sim/report/map_formats.h"
#include "sim/report/picture_files.h"
#include "sim/report/program_report.h"
#include "sim/report/stock_check.h"
#include "sim/report/summary.h"
#include "sim/scene/toml.h"

#if ABBE_RENDER
#include "render/film.h"
#include "render/picture.h"
#include "sim/report/program_film.h"
#endif

#if ABBE_RENDER
#include "render/residual_field.h"
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
    outcome.notice = "no ffmpeg on the PATH: to encode the film from the frames, run\n" +
                     shell_text(encoder_command("ffmpeg", encoding, film.path()));
  }
  return outcome;
}

#else

FilmOutcome write_film(const ResultFolder& folder, const FilmSource&, const FilmRequest&,
                       const Progress&) {
  throw BadInput(folder.path().string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "a program built without VTK");
}

#endif

namespace {

/// A case to be written and the requested formats.
struct SaveRequest {
  const Job& job;
  const Verdict& verdict;
  const std::vector<std::string>& formats;
  ResultMap map;
};

/// Returns the file name of a format.
std::string map_file_name(const std::string& format) {
  return format == track_format ? "track.npz" : "residual." + format;
}

/// Returns the facts, the figures of the map, and the list of its files.
nlohmann::ordered_json map_metadata_json(const SaveRequest& request) {
  nlohmann::ordered_json json = to_json(request.map.facts);
  const nlohmann::ordered_json figures = to_json(summary(request.job, request.verdict));
  for (const char* key : {"residual_um", "machine_um", "form_um", "texture_um", "vertices",
                          "cut_vertices", "uncut_vertices", "uncut_percent", "gouged_vertices",
                          "deepest_gouge_um", "deepest_gouge_is_bound", "outside_vertices"})
    json[key] = figures.at(key);
  json["triangles"] = request.map.design.triangles.rows();
  json["fields"] = {{"area_mm2", "a third of the area of the triangles around a vertex"},
                    {"middle_um",
                     "deviation at the centre of a triangle (vtp, npz): its weight in the "
                     "statistics is three quarters of the triangle, that of a corner one twelfth; "
                     "where it is nan or missing, a corner has one third"},
                    {"random_um",
                     "deviation at a random point of a triangle, for maps that their vertices do "
                     "not resolve: its weight is the whole triangle"},
                    {"residual_um", "deviation along the normal, nan where not cut"},
                    {"form_um", "the residual through the areal Gaussian filter"},
                    {"texture_um", "the residual minus the form"},
                    {"status", json["status"]},
                    {"cut_time_s", "time at which the surface was cut"},
                    {"cut_line", "program line that cut the surface, 0 where none did"}};
  json["files"] = nlohmann::ordered_json::array();
  for (const std::string& format : map_formats())
    if (std::ranges::find(request.formats, format) != request.formats.end())
      json["files"].push_back(map_file_name(format));
  return json;
}

using FormatWriter = void (*)(const ResultFile&, const SaveRequest&);

/// Returns the writers of all formats.
const std::map<std::string, FormatWriter>& format_writers() {
  static const std::map<std::string, FormatWriter> writers = {
#if ABBE_RENDER
    {"vtp",
     [](const ResultFile& file, const SaveRequest& request) {
       const ResultMap& map = request.map;
       write_file(file, [&](const std::filesystem::path& path) {
         render::write_residual(
             path,
             {map.design, map.residual_um, map.status, map.cut_time_s, map.cut_line,
              map.interior_sample, map.within_um, map.form_um, map.tolerance_um},
             fact_texts(map.facts));
       });
     }},
#endif
    {"ply", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_ply(request.map)); }},
    {"stl", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_stl(request.map)); }},
    {"csv", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_csv(request.map)); }},
    {"npz", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_npz(request.map)); }},
    {"json", [](const ResultFile& file,
                const SaveRequest& request) { write_json(file, map_metadata_json(request)); }},
    {track_format,
     [](const ResultFile& file, const SaveRequest& request) {
       const Job& job = request.job;
       write_file(file,
                  to_npz(in_part_frame(request.verdict.cut.track.value(), job.scene.part.T_wm),
                         kinematics::letters(job.machine.nominal.joints()), request.map.facts));
     }},
  };
  return writers;
}

}  // namespace

std::vector<std::string> map_formats() {
  std::vector<std::string> names;
  for (const char* name : {"vtp", "ply", "stl", "csv", "npz", "json", track_format})
    if (format_writers().contains(name)) names.emplace_back(name);
  return names;
}

std::vector<std::string> default_map_formats() {
  return format_writers().contains("vtp") ? std::vector<std::string>{"vtp"}
                                          : std::vector<std::string>{};
}

Retention required_retention(const std::vector<std::string>& formats) {
  return std::ranges::find(formats, track_format) == formats.end() ? Retention::Map
                                                                   : Retention::Track;
}

void write_map_files(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                     const std::vector<std::string>& formats, const Progress& progress) {
  const SaveRequest request{job, verdict, formats, result_map(job, verdict)};
  double written_count = 0.0;
  for (const auto& [format, write] : format_writers()) {
    if (progress) progress("write", written_count / double(format_writers().size()));
    written_count += 1.0;
    const ResultFile file = folder / map_file_name(format);
    if (std::ranges::find(formats, format) != formats.end())
      write(file, request);
    else
      // A file that an earlier run left would not belong to this case.
      remove_file(file);
  }
}

namespace {

/// Writes a file that only some cases have. If the text is empty, the file of an earlier run is
/// removed.
void write_or_remove(const ResultFile& file, const std::string& text) {
  if (text.empty())
    remove_file(file);
  else
    write_file(file, text);
}

/// Writes the collisions of a cut, or removes the file of an earlier run.
void write_collisions(const ResultFile& file, const Cut& cut) {
  if (!cut.collisions) return remove_file(file);
  Collisions collisions = *cut.collisions;
  collisions.commands = cut.name;
  write_json(file, to_json(collisions));
}

/// Writes the machined body as STL; its picture and ParaView file are written with the pictures.
void write_stock_mesh(const ResultFile& file, const Job& job, const Verdict& verdict) {
  if (!verdict.stock) return remove_file(file);
  write_file(file, to_stl(*verdict.stock, job, verdict));
}

}  // namespace

void write_program(const ResultFolder& folder, const Job& job) {
  if (job.program_text.empty()) return;
  write_file(folder / job.path.file, job.program_text);
}

void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                const std::vector<std::string>& formats, const Progress& progress) {
  // Both threads use the manifest of the folder, which has a lock, and nothing else in common.
  std::future<void> files =
      std::async(std::launch::async, [&] { write_map_files(folder, job, verdict, formats, {}); });
  write_case_pictures(folder, job, verdict, progress);
  write_source_pictures(folder, job, verdict);
  write_or_remove(folder / "signals.csv", verdict.cut.signals.columns.empty()
                                              ? ""
                                              : escape_keeping_lines(to_csv(verdict.cut.signals)));
  write_file(folder / "scene.toml",
             "case = " + to_toml_value(verdict.cut.case_name) + "\n" + job.scene.resolved);
  const ResultFile rewritten_file =
      folder / ("rewritten" + std::filesystem::path(job.path.file).extension().string());
  write_or_remove(rewritten_file, verdict.cut.rewritten_program);
  write_stock_mesh(folder / "stock.stl", job, verdict);
  write_collisions(folder / "collisions.json", verdict.cut);
  files.get();
  // The summary is written last, so that its presence marks a finished case.
  write_json(folder / "summary.json", to_json(summary(job, verdict)));
}

}  // namespace abbe::sim
