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

/// The frames of a film, frame_00001.png and so on, and what makes one file of them.
struct FilmEncoding {
  std::filesystem::path frames;  ///< their folder
  std::size_t count = 0;
  double fps = 25.0;
};

/// A program as the shell would find it on the PATH; none without one.
std::optional<std::filesystem::path> find_executable(const std::string& program);

/// How ffmpeg is called; the ending of `film` chooses the format: .mp4 (H.264) or .webm (VP9).
/// @param ffmpeg  the program
std::vector<std::string> encoder_command(const std::string& ffmpeg, const FilmEncoding& encoding,
                                         const std::filesystem::path& film);

/// The same for a person to type.
std::string shell_text(const std::vector<std::string>& command);

/// Runs it to its end, without a shell.
/// @param waiting  called again and again meanwhile; may throw, then it is ended
/// @throws std::runtime_error with its last words if it fails
void encode(const std::vector<std::string>& command, const std::function<void()>& waiting);

/// What is made of a film.
struct FilmRequest {
  FilmPlan plan;
  FilmOptions options;
  std::string format = "mp4";  ///< "mp4", "webm", or "none": the frames alone
};

/// What became of it.
struct FilmOutcome {
  std::filesystem::path frames;  ///< their folder
  std::size_t count = 0;
  std::optional<std::filesystem::path> film;  ///< none without ffmpeg
  std::string notice;  ///< where it could not be made: the command that would
};

/// Writes frames/frame_00001.png and so on and film.mp4 or film.webm; those of an earlier film are
/// removed first.
/// @param progress  shows two stages, "frames" and "encode"
/// @throws OutputFailure, Interrupted; BadInput where pictures are not built
FilmOutcome write_film(const ResultFolder& folder, const FilmSource& cut,
                       const FilmRequest& request, const Progress& progress = {});

}  // namespace abbe::sim
