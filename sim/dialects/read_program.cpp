#include "sim/dialects/read_program.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/front_ends.h"
#include "sim/dialects/linuxcnc/rs274.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

namespace {

constexpr std::size_t longest_word = 40;  // no word of any dialect is longer

/// A word in upper case in a fixed buffer, so that no memory is allocated for each of a million
/// words.
struct Word {
  std::array<char, longest_word> letters{};
  std::size_t size = 0;

  void put(char c) {
    if (size < letters.size()) letters[size++] = c;
  }
  std::string_view text() const { return {letters.data(), size}; }
};

/// Word table entries by their words.
using Index = std::unordered_map<std::string_view, const WordTableEntry*>;

Index index_of(std::span<const WordTableEntry> table) {
  Index index;
  for (const WordTableEntry& line : table)
    for (std::size_t at = 0; at < line.word.size();) {
      const std::size_t end = std::min(line.word.find(' ', at), line.word.size());
      index.emplace(line.word.substr(at, end - at), &line);
      at = end + 1;
    }
  return index;
}

/// Counts the known words of a program.
class Tally {
 public:
  explicit Tally(Index index) : index_(std::move(index)) {}

  bool add(std::string_view word, int line) {
    const auto known = index_.find(word);
    if (known == index_.end()) return false;
    const auto [at, is_new] = places_.try_emplace(known->first, words_.size());
    if (is_new)
      words_.push_back({std::string(word), known->second->use, known->second->sentence, 0, line});
    ++words_[at->second].count;
    return true;
  }
  std::vector<UsedWord> take() { return std::move(words_); }

 private:
  Index index_;
  std::unordered_map<std::string_view, std::size_t> places_;
  std::vector<UsedWord> words_;
};

/// Counts a word and the number behind it: as the code G1 for G01 if there is such a code, else the
/// word alone.
void count_word(std::string_view line, std::size_t& at, int number, Tally& tally) {
  Word word;
  while (at < line.size() && (is_letter(line[at]) || line[at] == '_')) word.put(upper(line[at++]));
  Word code = word;
  std::size_t from = at;
  // Leading zeros: G01 is G1, but G0 keeps its zero.
  while (from + 1 < line.size() && line[from] == '0' && is_digit(line[from + 1])) ++from;
  std::size_t end = from;
  while (end < line.size() && (is_digit(line[end]) || line[end] == '.')) code.put(line[end++]);
  if (end > at && tally.add(code.text(), number)) {
    at = end;
    return;
  }
  tally.add(word.text(), number);
  at = end;
}

/// Counts the words of a line. Text in ( ) or " " and behind ; is skipped.
void count_line(std::string_view line, int number, Tally& tally) {
  for (std::size_t at = 0; at < line.size();) {
    const char c = line[at];
    if (c == ';') return;
    if (c == '(' || c == '"') {
      const std::size_t end = line.find(c == '(' ? ')' : '"', at + 1);
      if (end == std::string_view::npos) return;
      at = end + 1;
    } else if (is_letter(c)) {
      count_word(line, at, number, tally);
    } else {
      ++at;
    }
  }
}

/// Counts a statement of cutter locations, i.e. its first word.
void count_major(std::string_view line, int number, Tally& tally) {
  std::size_t at = 0;
  while (at < line.size() && is_blank(line[at])) ++at;
  Word word;
  while (at < line.size() &&
         (is_letter(line[at]) || is_digit(line[at]) || line[at] == '-' || line[at] == '_'))
    word.put(upper(line[at++]));
  tally.add(word.text(), number);
}

}  // namespace

std::vector<UsedWord> used_words(std::string_view text, Dialect dialect, bool turning) {
  for (const FrontEnd& one : front_ends()) {
    if (one.dialect != dialect) continue;
    const bool other = turning && one.turning_words != nullptr;
    std::span<const WordTableEntry> words = other ? one.turning_words() : one.words();
    Tally tally(index_of(words));
    Lines lines(text);
    while (const auto line = lines.next()) {
      if (dialect == Dialect::Cl)
        count_major(*line, lines.number(), tally);
      else
        count_line(*line, lines.number(), tally);
    }
    return tally.take();
  }
  return {};
}

namespace {

// The dialect may be given in a scene without being one that can be read.
const FrontEnd& find_front_end(const Recognised& found, const std::string& file) {
  std::string known;
  for (const FrontEnd& one : front_ends()) {
    if (one.dialect == found.dialect) return one;
    known += (known.empty() ? "" : ", ") + std::string(name_of(one.dialect));
  }
  std::string seen(name_of(found.dialect));
  if (!found.sign.empty()) seen += ", as " + found.sign;
  throw BadInput(file, found.line, found.line > 0 ? 1 : 0, "a dialect that is read (" + known + ")",
                 std::move(seen));
}

/// Throws BadInput if the pole rule of one control is used with a program of another.
void check_rule(PoleRule rule, Dialect dialect, const std::string& file) {
  const auto check = [&](PoleRule one, const char* name, std::initializer_list<Dialect> fit,
                         const char* why) {
    if (rule != one || std::ranges::find(fit, dialect) != fit.end()) return;
    throw BadInput(file, 0, 0, fmt::format("{}, beside pole = \"{}\"", why, name),
                   fmt::format("one of {}", name_of(dialect)));
  };
  check(PoleRule::LinuxCnc, "linuxcnc", {Dialect::LinuxCnc},
        "a program of LinuxCNC, which has no vectors of the tool");
  check(PoleRule::Fanuc, "fanuc", {Dialect::Fanuc, Dialect::Cl},
        "a program of Fanuc or cutter locations");
  check(PoleRule::Siemens, "siemens", {Dialect::Siemens, Dialect::Cl},
        "a program of Siemens or cutter locations");
}

/// Merges errors at bytes of another encoding into one, however many lines contain such bytes.
std::vector<BadInput> merge_encoding_errors(const std::vector<BadInput>& input_errors,
                                            std::string_view text, const std::string& file) {
  if (!find_invalid_utf8(text)) return input_errors;
  std::map<int, std::pair<int, unsigned char>> foreign;  // column and byte, by line
  Lines lines(text);
  while (const auto line = lines.next())
    if (const auto at = find_invalid_utf8(*line))
      foreign[lines.number()] = {int(*at) + 1, static_cast<unsigned char>((*line)[*at])};
  std::vector<BadInput> kept;
  bool said = false;
  for (const BadInput& fault : input_errors) {
    // Only errors in lines with such bytes are merged.
    const auto byte = foreign.find(fault.line);
    if (fault.file != file || byte == foreign.end()) {
      kept.push_back(fault);
    } else if (!std::exchange(said, true)) {
      const auto [column, value] = byte->second;
      kept.emplace_back(file, fault.line, column, "words in ASCII",
                        fmt::format("a byte 0x{:02x}, as of Latin-1", value));
    }
  }
  return kept;
}

// Bytes; a retry with every dialect must stay short.
constexpr std::size_t max_tried = std::size_t(1) << 22;
// Enough to tell the dialects apart.
constexpr std::size_t max_trial_moves = 200'000;

/// Returns the number of input errors when the text is read in a dialect, or nothing if it makes no
/// move.
std::optional<std::size_t> errors_in(const FrontEnd& front_end, std::string_view text,
                                     const std::string& file, ReadOptions options) {
  options.dialect = front_end.dialect;
  // A trial must not pass on segments, report progress or fail on the pole rule of another control.
  options.on_path_segment = {};
  options.progress = {};
  options.pole = {};
  options.limits.blocks = std::min(options.limits.blocks, max_trial_moves);
  options.control.max_moves = std::min(options.control.max_moves, max_trial_moves);
  ProgramRun run(file, options);
  try {
    front_end.read(text, run);
  } catch (const BadInput&) {
    return std::nullopt;
  }
  if (run.canon.blocks() == 0) return std::nullopt;
  return run.input_errors().list().size();
}

/// Returns an error that names the dialect which reads the file with the fewest errors, if that is
/// fewer than the detected dialect gave.
std::optional<BadInput> other_dialect(std::string_view text, const std::string& file,
                                      const ReadOptions& options, const Recognised& found,
                                      std::size_t errors) {
  // A dialect that the user has given is not questioned.
  if (options.dialect != Dialect::Auto || text.size() > max_tried) return std::nullopt;
  const FrontEnd* best = nullptr;
  const std::size_t own = errors;
  for (const FrontEnd& one : front_ends()) {
    if (one.dialect == found.dialect) continue;
    const auto seen = errors_in(one, text, file, options);
    if (!seen || *seen >= errors) continue;
    best = &one;
    errors = *seen;
  }
  if (best == nullptr) return std::nullopt;
  return BadInput(
      file, 0, 0,
      fmt::format("dialect {}, which reads the file with {}", name_of(best->dialect),
                  errors == 0 ? "no input error" : fmt::format("{} input errors", errors)),
      fmt::format("{}, as {}, with {}", name_of(found.dialect), found.sign, own));
}

/// Throws BadInput for turning options that the control in use does not have.
void check_turning(const ReadOptions& options, Dialect dialect, const std::string& file) {
  const bool by_linuxcnc = options.interpreter == Interpreter::LinuxCnc;
  // rs274 has no option for diameters; G7 in the program does the same.
  if (by_linuxcnc && options.turning.x_words == XWordMeaning::Diameters)
    throw BadInput(file, 0, 0, "G7 in the program beside LinuxCNC's own interpreter",
                   "x_words = \"diameters\"");
  // Tips 0 and 9 are the centre of the nose, which every control can lead.
  if (options.turning.tip % 9 != 0 && dialect != Dialect::Fanuc && dialect != Dialect::Siemens)
    throw BadInput(file, 0, 0, "a program of Fanuc or Siemens beside the tip of a turning tool",
                   fmt::format("one of {}", name_of(dialect)));
}

/// Records the assumption that no limit was intended for the spindle under constant surface speed.
void note_unlimited_speed(ProgramRun& run) {
  const auto& speed = run.canon.unlimited_speed();
  if (!speed) return;
  run.canon.assume(
      {fmt::format(
           "nothing limits the spindle under G96, which comes as near to the axis as {:.6g} "
           "mm: the program states no largest speed (G50 S, LIMS=, D)",
           speed->radius),
       "machine.max_spindle_rpm", "", speed->line});
}

}  // namespace

ReadProgram read_program(std::string_view text, const std::string& file,
                         const ReadOptions& options) {
  if (text.size() > options.control.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.control.max_bytes),
                   fmt::format("{}", text.size()));
  try {
    check_encoding(text, file);
    // Thrown as the only error: every line would fail for the same reason.
  } catch (const BadInput& fault) {
    throw BadProgram({fault});
  }
  if (text.find('\0') != std::string_view::npos) {
    // Only tape characters are removed; another NUL is an error at its line.
    const std::string plain = strip_tape_characters(text);
    if (plain.size() < text.size()) return read_program(plain, file, options);
  }
  ReadProgram read;
  const Recognised found =
      options.dialect == Dialect::Auto ? recognised(text, file) : Recognised{options.dialect, {}};
  read.dialect = found.dialect;
  read.sign = found.sign;
  check_rule(options.pole.rule, found.dialect, file);
  check_turning(options, found.dialect, file);
  ProgramRun run(file, options, std::size_t(std::count(text.begin(), text.end(), '\n')) + 1);
  if (options.interpreter == Interpreter::LinuxCnc)
    read_by_linuxcnc(text, found, run);
  else
    find_front_end(found, file).read(text, run);
  // Passes on the last, incomplete segment.
  run.hand_over();
  if (!run.input_errors().empty()) {
    std::vector<BadInput> errors = merge_encoding_errors(run.input_errors().list(), text, file);
    // The hint at another dialect comes last, behind the errors that led to it.
    if (auto other = other_dialect(text, file, options, found, errors.size()))
      errors.push_back(std::move(*other));
    throw BadProgram(std::move(errors));
  }
  note_unlimited_speed(run);
  run.report_assumptions();
  read.turning = run.turning();
  read.skipped = run.skipped();
  read.warnings = std::move(run.warnings);
  read.blocks = run.blocks_executed();
  read.path = run.canon.take();
  return read;
}

ReadProgram read_program_file(const std::filesystem::path& file, ReadOptions options) {
  if (options.folder.empty())
    options.folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  return read_program(read_text(file, options.control.max_bytes), file.string(), options);
}

}  // namespace abbe::sim::dialects
