#include "sim/dialects/read_program.h"

#include "sim/dialects/cl/cl.h"
#include "sim/dialects/heidenhain/heidenhain.h"
#include "sim/dialects/linuxcnc/rs274.h"

// Reading of NC programs: the front ends of all dialects, the words that a program uses, and the
// errors of a wrong dialect.

namespace abbe::sim::dialects {

void read_cl(std::string_view text, ProgramRun& run) {
  if (cl::is_table(text)) {
    // A table has no statements in which a startup code could be written.
    run.run_startup_code([&](std::string_view code) {
      run.canon.throw_input_error({1, code}, "no startup code for a table of cutter locations");
    });
    return cl::read_table(text, run);
  }
  cl::Machine machine(run);
  run.run_startup_code([&](std::string_view code) {
    cl::Statements statements(code);
    cl::Statement statement;
    while (statements.next(statement)) machine.execute(statement);
  });
  cl::Statements statements(text);
  cl::Statement statement;
  while (!machine.has_ended() && !run.is_aborted() && statements.next(statement))
    run.try_block([&] {
      run.canon.set_line(statement.line);
      run.count_block();
      machine.execute(statement);
    });
  machine.finish();
  // Without FINI the whole text has been read.
  if (!machine.has_ended()) return;
  const std::vector<std::string_view> lines = lines_of_text(text);
  run.warn_of_unread_lines(lines, {{0, lines.size()}});
}

std::span<const FrontEnd> front_ends() {
  static constexpr std::array table = {
      FrontEnd{Dialect::LinuxCnc, "LinuxCNC (RS274/NGC)", read_linuxcnc, linuxcnc_words},
      FrontEnd{Dialect::Cl, "CL (APT cutter locations, CSV)", read_cl, cl_words},
      FrontEnd{Dialect::Fanuc, "Fanuc (milling, custom macro B)", read_fanuc, fanuc_words,
               fanuc_lathe_words, "Fanuc (turning, G-code system A)"},
      FrontEnd{Dialect::Siemens, "Siemens 840D", read_siemens, siemens_words},
      FrontEnd{Dialect::Heidenhain, "Heidenhain (TNC 640, Klartext)", read_heidenhain,
               heidenhain_words},
  };
  return table;
}

namespace {

/// Entries of a word table, by word.
using WordIndex = std::unordered_map<std::string_view, const WordTableEntry*>;

WordIndex index_words(std::span<const WordTableEntry> table) {
  WordIndex index;
  for (const WordTableEntry& entry : table)
    each_word(entry.word, [&](std::string_view word) { index.emplace(word, &entry); });
  return index;
}

/// Counter of the known words of a program.
class WordCounter {
 public:
  explicit WordCounter(WordIndex index) : index_(std::move(index)) {}

  /// Counts a word. Returns false if the dialect does not have it.
  bool add(std::string_view word, int line) {
    const auto entry = index_.find(word);
    if (entry == index_.end()) return false;
    const auto [slot, is_new] = slots_.try_emplace(entry->first, words_.size());
    if (is_new)
      words_.push_back({std::string(word), entry->second->use, entry->second->sentence, 0, line});
    ++words_[slot->second].count;
    return true;
  }
  std::vector<UsedWord> take() { return std::move(words_); }

 private:
  WordIndex index_;
  std::unordered_map<std::string_view, std::size_t> slots_;  ///< index in `words_` by word
  std::vector<UsedWord> words_;
};

/// Counts the word at `at` and advances past it and its number. G01 counts as the code G1 if the
/// dialect has that code; otherwise only the letters are counted.
void count_word(std::string_view line, std::size_t& at, int line_number, WordCounter& counter) {
  std::string word;
  while (at < line.size() && (is_letter(line[at]) || line[at] == '_')) word += upper(line[at++]);
  std::string code = word;
  std::size_t from = at;
  // Leading zeros: G01 is G1, but G0 keeps its zero.
  while (from + 1 < line.size() && line[from] == '0' && is_digit(line[from + 1])) ++from;
  std::size_t end = from;
  while (end < line.size() && (is_digit(line[end]) || line[end] == '.')) code += line[end++];
  if (end == at || !counter.add(code, line_number)) counter.add(word, line_number);
  at = end;
}

/// Counts the words of a line. Text in ( ) or " " and after ; is skipped.
void count_line(std::string_view line, int line_number, WordCounter& counter) {
  for (std::size_t at = 0; at < line.size();) {
    const char c = line[at];
    if (c == ';') return;
    if (c == '(' || c == '"') {
      const std::size_t end = line.find(c == '(' ? ')' : '"', at + 1);
      if (end == std::string_view::npos) return;
      at = end + 1;
    } else if (is_letter(c)) {
      count_word(line, at, line_number, counter);
    } else {
      ++at;
    }
  }
}

/// Counts the major word of an APT statement, which is its first word.
void count_major_word(std::string_view line, int line_number, WordCounter& counter) {
  std::size_t at = 0;
  while (at < line.size() && is_blank(line[at])) ++at;
  std::string word;
  while (at < line.size() &&
         (is_letter(line[at]) || is_digit(line[at]) || line[at] == '-' || line[at] == '_'))
    word += upper(line[at++]);
  counter.add(word, line_number);
}

}  // namespace

std::vector<UsedWord> used_words(std::string_view text, Dialect dialect, bool turning) {
  for (const FrontEnd& front_end : front_ends()) {
    if (front_end.dialect != dialect) continue;
    const bool has_turning_words = turning && front_end.turning_words != nullptr;
    WordCounter counter(
        index_words(has_turning_words ? front_end.turning_words() : front_end.words()));
    LineReader lines(text);
    while (const auto line = lines.next()) {
      if (dialect == Dialect::Cl)
        count_major_word(*line, lines.number(), counter);
      else
        count_line(*line, lines.number(), counter);
    }
    return counter.take();
  }
  return {};
}

namespace {

/// Returns the front end of a dialect. Throws BadInput if it has none, since a scene may state any
/// dialect.
const FrontEnd& find_front_end(const DetectedDialect& detected, const std::string& file) {
  std::string known_dialects;
  for (const FrontEnd& front_end : front_ends()) {
    if (front_end.dialect == detected.dialect) return front_end;
    known_dialects +=
        (known_dialects.empty() ? "" : ", ") + std::string(name_of(front_end.dialect));
  }
  std::string seen(name_of(detected.dialect));
  if (!detected.evidence.empty()) seen += ", as " + detected.evidence;
  throw BadInput(file, detected.line, detected.line > 0 ? 1 : 0,
                 "a supported dialect (" + known_dialects + ")", std::move(seen));
}

/// Throws BadInput if the pole rule of one control is used with a program of another.
void check_pole_rule(PoleRule rule, Dialect dialect, const std::string& file) {
  const auto check = [&](PoleRule checked_rule, const char* name,
                         std::initializer_list<Dialect> dialects, const char* expected) {
    if (rule != checked_rule || std::ranges::find(dialects, dialect) != dialects.end()) return;
    throw BadInput(file, 0, 0, fmt::format("{}, with pole = \"{}\"", expected, name),
                   fmt::format("a {} program", name_of(dialect)));
  };
  check(PoleRule::LinuxCnc, "linuxcnc", {Dialect::LinuxCnc},
        "a LinuxCNC program, which has no tool vectors");
  check(PoleRule::Fanuc, "fanuc", {Dialect::Fanuc, Dialect::Cl}, "a Fanuc or CL program");
  check(PoleRule::Siemens, "siemens", {Dialect::Siemens, Dialect::Cl}, "a Siemens or CL program");
}

/// Merges the errors of all lines with bytes of another encoding into one error.
std::vector<BadInput> merge_encoding_errors(const std::vector<BadInput>& input_errors,
                                            std::string_view text, const std::string& file) {
  if (!find_invalid_utf8(text)) return input_errors;
  std::map<int, std::pair<int, unsigned char>> foreign_bytes;  // column and byte, by line
  LineReader lines(text);
  while (const auto line = lines.next())
    if (const auto at = find_invalid_utf8(*line))
      foreign_bytes[lines.number()] = {int(*at) + 1, static_cast<unsigned char>((*line)[*at])};
  std::vector<BadInput> merged_errors;
  bool is_reported = false;
  for (const BadInput& input_error : input_errors) {
    // Only errors in lines with such bytes are merged.
    const auto byte = foreign_bytes.find(input_error.line);
    if (input_error.file != file || byte == foreign_bytes.end()) {
      merged_errors.push_back(input_error);
    } else if (!std::exchange(is_reported, true)) {
      const auto [column, value] = byte->second;
      merged_errors.emplace_back(file, input_error.line, column, "words in ASCII",
                                 fmt::format("a byte 0x{:02x}, as in Latin-1", value));
    }
  }
  return merged_errors;
}

// Bytes; a retry with every dialect must stay short.
constexpr std::size_t max_trial_bytes = std::size_t(1) << 22;
// Enough moves to tell the dialects apart.
constexpr std::size_t max_trial_moves = 200'000;

/// Returns the number of input errors when the text is read in a dialect, or nothing if it makes no
/// move.
std::optional<std::size_t> count_errors(const FrontEnd& front_end, std::string_view text,
                                        const std::string& file, ReadOptions options) {
  options.dialect = front_end.dialect;
  // A trial must not emit segments, report progress or fail because of the pole rule of another
  // control.
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

/// Returns an error that names the dialect which reads the file with the fewest errors. Returns
/// nothing if no dialect reads it with fewer errors than the detected one, which had `errors`.
std::optional<BadInput> suggest_dialect(std::string_view text, const std::string& file,
                                        const ReadOptions& options, const DetectedDialect& detected,
                                        std::size_t errors) {
  // A dialect that the user stated is not questioned.
  if (options.dialect != Dialect::Auto || text.size() > max_trial_bytes) return std::nullopt;
  const FrontEnd* best_front_end = nullptr;
  std::size_t min_errors = errors;
  for (const FrontEnd& front_end : front_ends()) {
    if (front_end.dialect == detected.dialect) continue;
    const auto trial_errors = count_errors(front_end, text, file, options);
    if (!trial_errors || *trial_errors >= min_errors) continue;
    best_front_end = &front_end;
    min_errors = *trial_errors;
  }
  if (best_front_end == nullptr) return std::nullopt;
  return BadInput(
      file, 0, 0,
      fmt::format("dialect {}, which reads the file with {}", name_of(best_front_end->dialect),
                  min_errors == 0 ? "no input error" : fmt::format("{} input errors", min_errors)),
      fmt::format("{}, as {}, with {}", name_of(detected.dialect), detected.evidence, errors));
}

/// Throws BadInput for options of a turning control that the control of this program does not have.
void check_turning(const ReadOptions& options, Dialect dialect, const std::string& file) {
  const bool uses_linuxcnc = options.interpreter == Interpreter::LinuxCnc;
  // rs274 has no option for diameters; G7 in the program does the same.
  if (uses_linuxcnc && options.turning.x_words == XWordMeaning::Diameters)
    throw BadInput(file, 0, 0, "G7 in the program with LinuxCNC's own interpreter",
                   "x_words = \"diameters\"");
  // Tips 0 and 9 are the centre of the nose, which every control can lead.
  if (options.turning.tip_number % 9 != 0 && dialect != Dialect::Fanuc &&
      dialect != Dialect::Siemens)
    throw BadInput(file, 0, 0, "a Fanuc or Siemens program with the tip of a turning tool",
                   fmt::format("a {} program", name_of(dialect)));
}

/// Records the assumption that the program intended no limit of the spindle speed under constant
/// surface speed.
void note_unlimited_speed(ProgramRun& run) {
  const auto& closest_approach = run.canon.unlimited_speed();
  if (!closest_approach) return;
  run.canon.assume({fmt::format("the spindle speed under G96 is not limited at a radius down to "
                                "{:.6g} mm: the program states no maximum speed (G50 S, LIMS=, D)",
                                closest_approach->radius),
                    "machine.max_spindle_rpm", "", closest_approach->line});
}

}  // namespace

ParsedProgram read_program(std::string_view text, const std::string& file,
                           const ReadOptions& options) {
  if (text.size() > options.control.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.control.max_bytes),
                   fmt::format("{}", text.size()));
  try {
    check_encoding(text, file);
  } catch (const BadInput& input_error) {
    // The only error that is reported: every line would fail for the same reason.
    throw BadProgram({input_error});
  }
  if (text.find('\0') != std::string_view::npos) {
    // Only tape characters are removed; another NUL is an error at its line.
    const std::string plain_text = strip_tape_characters(text);
    if (plain_text.size() < text.size()) return read_program(plain_text, file, options);
  }
  ParsedProgram result;
  const DetectedDialect detected = options.dialect == Dialect::Auto
                                       ? detect_dialect(text, file)
                                       : DetectedDialect{options.dialect, {}};
  result.dialect = detected.dialect;
  result.sign = detected.evidence;
  check_pole_rule(options.pole.rule, detected.dialect, file);
  check_turning(options, detected.dialect, file);
  ProgramRun run(file, options, std::size_t(std::count(text.begin(), text.end(), '\n')) + 1);
  if (options.interpreter == Interpreter::LinuxCnc)
    read_by_linuxcnc(text, detected, run);
  else
    find_front_end(detected, file).read(text, run);
  // The last, incomplete segment.
  run.emit_segment();
  if (!run.input_errors().empty()) {
    std::vector<BadInput> errors = merge_encoding_errors(run.input_errors().list(), text, file);
    // The suggestion of another dialect comes last, after the errors that led to it.
    if (auto suggestion = suggest_dialect(text, file, options, detected, errors.size()))
      errors.push_back(std::move(*suggestion));
    throw BadProgram(std::move(errors));
  }
  note_unlimited_speed(run);
  run.report_assumptions();
  result.turning = run.is_turning();
  result.skipped = run.skipped();
  result.warnings = std::move(run.warnings);
  result.blocks = run.blocks_executed();
  result.path = run.canon.take();
  return result;
}

ParsedProgram read_program_file(const std::filesystem::path& file, ReadOptions options) {
  if (options.subprogram_folder.empty())
    options.subprogram_folder =
        file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  return read_program(read_text(file, options.control.max_bytes), file.string(), options);
}

}  // namespace abbe::sim::dialects
