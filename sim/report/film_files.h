#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/report/film_plan.h"
#include "sim/report/filmed_cut.h"

namespace abbe::sim {

/// What is made of a film.
struct FilmRequest {
  FilmPlan plan;
  FilmOptions options;
  std::string format = "mp4";  ///< "mp4", "webm", or "none": the frames alone
};

/// What became of it.
struct FilmWritten {
  std::filesystem::path frames;  ///< their folder
  std::size_t count = 0;
  std::optional<std::filesystem::path> film;  ///< none without ffmpeg
  std::string notice;  ///< where it could not be made: the command that would
};

/// Writes frames/frame_00001.png and so on and film.mp4 or film.webm; those of an earlier film are
/// removed first.
/// @param progress  shows two stages, "frames" and "encode"
/// @throws OutputFailure, Interrupted; BadInput where pictures are not built
FilmWritten write_film(const ResultFolder& folder, const FilmedCut& cut, const FilmRequest& request,
                       const Progress& progress = {});

}  // namespace abbe::sim
