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

}  // namespace abbe::sim
