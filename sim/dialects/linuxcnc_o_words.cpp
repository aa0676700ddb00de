#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/dialects/linuxcnc_flow.h"

namespace abbe::sim::dialects::linuxcnc {

namespace {

constexpr std::size_t most_file = std::size_t(1) << 26;  // bytes of a subprogram
constexpr std::size_t most_sources = 1000;
constexpr double most_repeats = 1e9;

}  // namespace

/// The O word that a line begins with, block delete and line number left out; none if it has none.
std::optional<OWord> Flow::o_word(Cursor& cursor) {
  cursor.skip_blanks();
  if (cursor.here() == '/') {
    if (run_.canon.options().block_skip.test(0)) return std::nullopt;
    ++cursor.at;
    cursor.skip_blanks();
  }
  if (upper(cursor.here()) == 'N') {
    ++cursor.at;
    cursor.number(false, true);
    cursor.skip_blanks();
  }
  if (upper(cursor.here()) != 'O') return std::nullopt;
  OWord o;
  const std::size_t from = cursor.at++;
  cursor.skip_blanks();
  if (cursor.here() == '<') {
    o.label = "<" + name_in_brackets(cursor) + ">";
  } else {
    const std::size_t number = cursor.at;
    o.label = fmt::format("{}", whole(cursor, number, value(cursor, grammar(), *this), 1000000));
  }
  cursor.skip_blanks();
  while (is_letter(cursor.here())) o.word += char(upper(cursor.text[cursor.at++]) - 'A' + 'a');
  o.cause = cursor.cause(from);
  o.rest = cursor.at;
  return o;
}

/// The same of a line that is only looked at: labels that are worked out there are none.
std::optional<OWord> Flow::o_word_of(const Source& source, std::size_t at) {
  const std::string_view text = source.lines[at];
  Cursor cursor = cursor_at(source, at);
  std::size_t i = text.find_first_not_of(" \t");
  if (i == std::string_view::npos) return std::nullopt;
  const char c = upper(text[i]);
  if (c != 'O' && c != 'N' && c != '/') return std::nullopt;
  try {
    return o_word(cursor);
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

std::size_t Flow::next_of(const OWord& o, std::initializer_list<std::string_view> words) {
  const Source& source = *calls_.back().source;
  std::string key = fmt::format("{}:{}:{}", source.file, at_, *words.begin());
  if (const auto known = jumps_.find(key); known != jumps_.end()) return known->second;
  for (std::size_t i = at_ + 1; i < source.lines.size(); ++i) {
    const auto other = o_word_of(source, i);
    if (!other || other->label != o.label) continue;
    if (std::find(words.begin(), words.end(), other->word) == words.end()) continue;
    jumps_.emplace(std::move(key), i);
    return i;
  }
  run_.canon.refuse(o.cause, fmt::format("o{} {} behind it", o.label, *(words.end() - 1)), "none");
}

double Flow::condition(Cursor& cursor) {
  const double result = bracketed(cursor, grammar(), *this);
  ends(cursor);
  return result;
}

/// Nothing but a comment follows.
void Flow::ends(Cursor& cursor) const {
  cursor.skip_blanks();
  if (!cursor.at_end() && cursor.here() != '(' && cursor.here() != ';')
    cursor.refuse(cursor.at, "nothing more behind an O word");
}

void Flow::o_line(const OWord& o, Cursor cursor) {
  const auto is = [&](std::initializer_list<std::string_view> words) {
    return std::find(words.begin(), words.end(), o.word) != words.end();
  };
  cursor.at = o.rest;
  if (is({"if", "elseif", "else", "endif"})) return branch(o, cursor);
  if (is({"while", "endwhile", "do", "repeat", "endrepeat"})) return loop(o, cursor);
  if (is({"break", "continue"})) return leave_loop(o, o.word == "continue");
  if (o.word == "call") return call(o, cursor);
  if (is({"return", "endsub"})) return leave(o, cursor);
  if (o.word == "sub") {
    if (calls_.size() > 1) run_.canon.refuse(o.cause, "endsub before another sub");
    at_ = next_of(o, {"endsub"}) + 1;
    return;
  }
  run_.canon.refuse(o.cause,
                    "sub endsub call return if elseif else endif while endwhile do repeat "
                    "endrepeat break or continue after an O word");
}

void Flow::branch(const OWord& o, Cursor& cursor) {
  std::string key = fmt::format("{}:{}", calls_.back().source->file, o.label);
  if (o.word == "if")
    begun_ifs_.insert(std::move(key));
  else if (!begun_ifs_.contains(key))
    run_.canon.refuse(o.cause, fmt::format("o{} if before {}", o.label, o.word), "none");
  if (o.word == "endif") {
    ++at_;
    return;
  }
  if (o.word != "if") {  // the branch before it has run
    at_ = next_of(o, {"endif"}) + 1;
    return;
  }
  if (condition(cursor) != 0) {
    ++at_;
    return;
  }
  while (true) {
    at_ = next_of(o, {"elseif", "else", "endif"});
    run_.count_block();
    const Source& source = *calls_.back().source;
    run_.canon.stand_at(int(at_) + 1, source.file);
    Cursor next = cursor_at(source, at_);
    const auto other = o_word(next);
    next.at = other->rest;
    if (other->word != "elseif" || condition(next) != 0) break;
  }
  ++at_;
}

void Flow::loop(const OWord& o, Cursor& cursor) {
  std::vector<Loop>& loops = calls_.back().loops;
  run_.check_depth(int(loops.size()), o.cause, "loops");
  const bool running = !loops.empty() && loops.back().label == o.label;
  if (o.word == "do") {
    loops.push_back({o.label, Loop::Kind::Do, at_});
    ++at_;
  } else if (o.word == "while" && running && loops.back().kind == Loop::Kind::Do) {
    if (condition(cursor) != 0) {
      at_ = loops.back().line + 1;
    } else {
      loops.pop_back();
      ++at_;
    }
  } else if (o.word == "while") {
    const bool again =
        running && loops.back().kind == Loop::Kind::While && loops.back().line == at_;
    if (condition(cursor) != 0) {
      if (!again) loops.push_back({o.label, Loop::Kind::While, at_});
      ++at_;
    } else {
      if (again) loops.pop_back();
      at_ = next_of(o, {"endwhile"}) + 1;
    }
  } else if (o.word == "endwhile") {
    if (!running || loops.back().kind != Loop::Kind::While)
      run_.canon.refuse(o.cause, fmt::format("o{} while before endwhile", o.label), "none");
    at_ = loops.back().line;
  } else if (o.word == "repeat") {
    const double count = condition(cursor);
    if (!(count <= most_repeats)) run_.canon.refuse(o.cause, "at most 1e9 repeats");
    if (std::llround(count) <= 0) {
      at_ = next_of(o, {"endrepeat"}) + 1;
    } else {
      loops.push_back({o.label, Loop::Kind::Repeat, at_, std::llround(count)});
      ++at_;
    }
  } else {
    if (!running || loops.back().kind != Loop::Kind::Repeat)
      run_.canon.refuse(o.cause, fmt::format("o{} repeat before endrepeat", o.label), "none");
    if (--loops.back().left > 0) {
      at_ = loops.back().line + 1;
    } else {
      loops.pop_back();
      ++at_;
    }
  }
}

/// break and continue, of the loop of that label; loops within it end.
void Flow::leave_loop(const OWord& o, bool again) {
  std::vector<Loop>& loops = calls_.back().loops;
  const auto found = std::find_if(loops.rbegin(), loops.rend(),
                                  [&](const Loop& one) { return one.label == o.label; });
  if (found == loops.rend())
    run_.canon.refuse(o.cause, "a loop of this label around " + o.word, "none");
  loops.erase(found.base(), loops.end());
  const Loop loop = loops.back();
  const std::string_view end = loop.kind == Loop::Kind::While ? "endwhile"
                               : loop.kind == Loop::Kind::Do  ? "while"
                                                              : "endrepeat";
  if (again) {
    at_ = loop.kind == Loop::Kind::While ? loop.line : next_of(o, {end});
  } else {
    at_ = next_of(o, {end}) + 1;
    loops.pop_back();
  }
}

const Source& Flow::source_of(const std::filesystem::path& file) {
  if (sources_.size() == most_sources)
    run_.canon.refuse({1, {}}, "at most 1000 files of subprograms", "more");
  auto source = std::make_unique<Source>();
  source->text = read_text(file, most_file);
  source->lines = lines_of_text(source->text);
  source->file = run_.canon.add_file(file.string());
  sources_.push_back(std::move(source));
  return *sources_.back();
}

/// In the file that runs, in the main program, else in a file of its name.
Flow::Sub Flow::find_sub(const OWord& o) {
  const auto key = [&](const Source& source) { return fmt::format("{}:{}", source.file, o.label); };
  for (const Source* source : {calls_.back().source, (const Source*)sources_.front().get()}) {
    if (const auto known = subs_.find(key(*source)); known != subs_.end()) return known->second;
    for (std::size_t i = 0; i < source->lines.size(); ++i)
      if (const auto other = o_word_of(*source, i);
          other && other->word == "sub" && other->label == o.label)
        return subs_[key(*source)] = {source, i};
  }
  const std::string of_file = "file:" + o.label;
  if (const auto known = subs_.find(of_file); known != subs_.end()) return known->second;
  const bool named = o.label.front() == '<';
  const std::string name = named ? o.label.substr(1, o.label.size() - 2) : o.label;
  const auto is_name = [](char c) {
    return is_letter(c) || is_digit(c) || c == '_' || c == '-' || c == '.';
  };
  const std::filesystem::path file = run_.options().folder / (name + ".ngc");
  std::error_code failure;
  if (run_.options().folder.empty() || name.front() == '.' ||
      !std::all_of(name.begin(), name.end(), is_name) ||
      !std::filesystem::is_regular_file(file, failure))
    run_.refuse_once(
        "o" + o.label, o.cause,
        fmt::format("a subprogram o{} in the program, or {}.ngc beside it", o.label, name), "none");
  const Source& source = source_of(file);
  for (std::size_t i = 0; i < source.lines.size(); ++i)
    if (const auto other = o_word_of(source, i);
        other && other->word == "sub" && other->label == o.label)
      return subs_[of_file] = {&source, i};
  run_.canon.refuse(o.cause, fmt::format("o{} sub in {}", o.label, file.string()), "none");
}

void Flow::call(const OWord& o, Cursor& cursor) {
  std::array<double, 31> arguments{};
  std::size_t n = 0;
  for (cursor.skip_blanks(); cursor.here() == '['; cursor.skip_blanks()) {
    const std::size_t from = cursor.at;
    if (++n > 30) cursor.refuse(from, "at most 30 arguments", "more");
    arguments[n] = bracketed(cursor, grammar(), *this);
  }
  ends(cursor);
  run_.check_depth(int(calls_.size()), o.cause);
  const Sub sub = find_sub(o);
  Call next{.source = sub.source, .back = at_ + 1, .name = o.label};
  next.locals = arguments;
  calls_.push_back(std::move(next));
  variables_.enter();
  at_ = sub.line + 1;
}

void Flow::leave(const OWord& o, Cursor& cursor) {
  if (calls_.size() == 1) run_.canon.refuse(o.cause, "a call before " + o.word, "none");
  if (calls_.back().name != o.label)
    run_.canon.refuse(o.cause, fmt::format("o{} {}", calls_.back().name, o.word));
  cursor.skip_blanks();
  std::optional<double> result;
  if (cursor.here() == '[') result = bracketed(cursor, grammar(), *this);
  ends(cursor);
  const Call ended = calls_.back();
  at_ = ended.back;
  calls_.pop_back();
  variables_.leave();
  if (ended.restores && ended.saved) machine_.restore(*ended.saved, o.cause);
  if (!variables_.set("_value", result.value_or(0.0)) ||
      !variables_.set("_value_returned", result ? 1.0 : 0.0))
    cursor.refuse(0, "fewer parameters", "too many");
}

void Flow::end_of_file() {
  const Call ended = calls_.back();
  at_ = ended.back;
  calls_.pop_back();
  variables_.leave();
  const program::NcPlace place = run_.canon.place();
  throw BadInput(place.file, place.line, 0, fmt::format("o{} endsub", ended.name),
                 "the end of the file");
}

}  // namespace abbe::sim::dialects::linuxcnc
