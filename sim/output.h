#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace abbe::sim {

/// Output could not be written: exit 5.
struct OutputFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Makes the folder and proves that a file can be written in it.
/// @throws OutputFailure naming the folder and the system's reason
void prepare_folder(const std::filesystem::path& folder);

/// Runs `write` on a temporary name beside `file`, flushes, and renames it to `file`; on failure
/// nothing is left of it and an older `file` stands as it was.
/// @throws OutputFailure
void write_file(const std::filesystem::path& file,
                const std::function<void(const std::filesystem::path&)>& write);

/// The same for a text.
void write_file(const std::filesystem::path& file, std::string_view text);

}  // namespace abbe::sim
