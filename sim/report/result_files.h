#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/report/program_film.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// Frames to encode as one film, named frame_00001.png and so on.
struct FilmEncoding {
  std::filesystem::path frames;  ///< folder of the frames
  std::size_t count = 0;
  double fps = 25.0;
};

/// Returns the path of a program on the PATH; empty if it is not found.
std::optional<std::filesystem::path> find_executable(const std::string& program);

/// Returns the command line of ffmpeg; the extension of `film` selects the format: .mp4 (H.264) or
/// .webm (VP9).
/// @param ffmpeg  path of the program
std::vector<std::string> encoder_command(const std::string& ffmpeg, const FilmEncoding& encoding,
                                         const std::filesystem::path& film);

/// Returns the command line quoted for a shell.
std::string shell_text(const std::vector<std::string>& command);

/// Runs a command until it ends, without a shell.
/// @param waiting  called repeatedly meanwhile; if it throws, the command is stopped
/// @throws std::runtime_error with the last output of the command if it fails
void encode(const std::vector<std::string>& command, const std::function<void()>& waiting);

/// Request of `abbe animate`.
struct FilmRequest {
  FilmPlan plan;
  FilmOptions options;
  std::string format = "mp4";  ///< "mp4", "webm", or "none": frames only
};

/// Result of writing a film.
struct FilmOutcome {
  std::filesystem::path frames;  ///< folder of the frames
  std::size_t count = 0;
  std::optional<std::filesystem::path> film;  ///< empty without ffmpeg
  std::string notice;  ///< without ffmpeg: the command that encodes the frames
};

/// Writes the frames (frames/frame_00001.png and so on) and the film (film.mp4 or film.webm). Those
/// of an earlier film are removed first.
/// @param progress  shows two stages, "frames" and "encode"
/// @throws OutputFailure, Interrupted; BadInput if the program was built without pictures
FilmOutcome write_film(const ResultFolder& folder, const FilmSource& source,
                       const FilmRequest& request, const Progress& progress = {});

/// Name of the format of the tool's track, saved as `track.npz`. The cut must have retained the
/// track.
inline constexpr const char* track_format = "track";

/// Returns the formats in which a map can be saved, as `--save` names them; "vtp" only if the
/// program was built with VTK.
std::vector<std::string> map_formats();

/// Returns the formats that are saved by default.
std::vector<std::string> default_map_formats();

/// Returns the data that must be kept of a cut for these formats.
Retention required_retention(const std::vector<std::string>& formats);

/// Writes `residual.FORMAT` for each format, and removes the files of other formats that an earlier
/// run left.
/// @param progress  shows one stage, "write"
/// @throws OutputFailure, Interrupted
void write_map_files(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                     const std::vector<std::string>& formats, const Progress& progress = {});

/// Writes `program.ngc` or `program.csv` of a generated program.
/// @throws OutputFailure
void write_program(const ResultFolder& folder, const Job& job);

/// Writes all files of a case into its folder.
/// @param formats  of its map, a subset of `map_formats`
/// @throws OutputFailure, Interrupted
void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                const std::vector<std::string>& formats, const Progress& progress = {});

}  // namespace abbe::sim
