#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace abbe::sim {

/// The frames of a film, frame_00001.png and so on, and what makes one file of them.
struct FilmEncoding {
  std::filesystem::path frames;  ///< their folder
  std::size_t count = 0;
  double fps = 25.0;
};

/// A program as the shell would find it on the PATH; none without one.
std::optional<std::filesystem::path> found_on_path(const std::string& program);

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

}  // namespace abbe::sim
