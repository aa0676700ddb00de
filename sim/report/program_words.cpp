#include "sim/report/program_words.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <variant>

#include "kinematics/escape.h"

namespace abbe::sim {
namespace {

constexpr std::size_t longest_shown = 200;  // bytes

std::vector<std::string> words_in(std::istream& in) {
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) {
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    line.resize(std::min(line.size(), longest_shown));
    lines.push_back(std::move(line));
  }
  return lines;
}

std::vector<std::string> words_in_file(const std::filesystem::path& file) {
  constexpr std::uintmax_t largest = std::uintmax_t(256) << 20;  // more is not worth its memory
  std::error_code failure;
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (failure || size > largest) return {};
  std::ifstream in(file);
  return words_in(in);
}

}  // namespace

ProgramWords::ProgramWords(const Job& job, const Commands& commands) {
  const std::string& text =
      commands.rewritten_program.empty() ? job.program_text : commands.rewritten_program;
  if (!text.empty()) {
    std::istringstream in(text);
    files_.push_back(words_in(in));
  } else if (const auto* file = std::get_if<ProgramDescription::File>(&job.scene.program.source)) {
    files_.push_back(words_in_file(file->file));
  } else {
    files_.emplace_back();
  }
  for (const std::string& more : path_of(job, commands).more_files)
    files_.push_back(words_in_file(more));
}

std::string ProgramWords::of(const program::Block& block) const {
  if (block.file >= files_.size() || block.line < 1) return {};
  const std::vector<std::string>& lines = files_[block.file];
  const auto row = std::size_t(block.line) - 1;
  return row < lines.size() ? escaped(lines[row]) : std::string();
}

}  // namespace abbe::sim
