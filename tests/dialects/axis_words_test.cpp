// Axis words beside every word of every dialect's table that is no motion: they may move nothing,
// or be an input error. What is without effect changes no later move either, and what the table
// refuses is an input error. The words come from the tables of milling and turning controls, so
// that new ones are tried as well.

#include <cctype>
#include "sim/dialects/read_program.h"
#include "tests/dialects/lathe.h"
#include "tests/test.h"

namespace abbe::sim::dialects::axis_words_tests {
namespace {

namespace machines = program::test;

/// A program of three parts: where the axes stand at F, the line that is tried, a move behind it.
struct Frame {
  Dialect dialect;
  std::string before, after;
  bool turning = false;
};

const Frame frames[] = {
    {Dialect::LinuxCnc, "G21 G90 G17 G94\nG1 X1 Y2 Z3 F100\n", "X50 Y60 Z70\nM2\n"},
    {Dialect::Fanuc, "O1\nG21 G90 G17 G94\nG1 X1. Y2. Z3. F100.\n", "X50. Y60. Z70.\nM30\n"},
    {Dialect::Siemens, "G71 G90 G17 G94\nG1 X1 Y2 Z3 F100\n", "X50 Y60 Z70\nM30\n"},
    {Dialect::Heidenhain, "BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X+1 Y+2 Z+3 R0 F100\n",
     "L X+50 Y+60 Z+70\nEND PGM A MM\n"},
    {Dialect::LinuxCnc, "G21 G90 G18 G94 G7\nG1 X10 Z3 F100\n", "X50 Z70\nM2\n", true},
    {Dialect::Fanuc, "O1\nG21 G18 G98\nT0101\nG1 X10. Z3. F100.\n", "X50. Z70.\nM30\n", true},
    {Dialect::Siemens, "G71 G90 G18 G94 DIAMON\nT1 D1\nG1 X10 Z3 F100\n", "X50 Z70\nM30\n", true},
    {Dialect::Cl, "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/1,2,3\n", "GOTO/50,60,70\nFINI\n"},
};

/// Words that may stand behind one, of all kinds that codes own.
const std::vector<std::string>& words_behind(const Frame& frame) {
  static const std::vector<std::string> lathe = {
      "X7. Z9.", "X0. Z0.",     "U7. W9.",   "Z9.",  "X7. Z9. R1. P1",
      "U7.",     "X7. I6. K4.", "P1 Q1 X7.", "W-5.", "C30. X7."};
  static const std::vector<std::string> siemens_lathe = {
      "X7 Z9",  "X0 Z0",      "Z9",          "X=7 Z=9",  "X=IC(7)",  "(X,Z) X7",   "=5 X7 Z9",
      "(1) X7", "(\"A\") X7", "[X]=5 X7 Z9", "X7 I6 K4", "X7 RP=40", "X7 CR=30 Z9"};
  if (frame.turning) return frame.dialect == Dialect::Siemens ? siemens_lathe : lathe;
  static const std::vector<std::string> iso = {
      "X7. Y8. Z9.",         "X0. Y0.",       "Z9.",        "A4. C5.",     "X7. Y8. Z9. A4.",
      "X7. Y8. I6. J5. K4.", "X7. Y8. R3.",   "X7. Y8. P2", "X7. Y8. Q2.", "X7. Y8. Z9. R1 P1 Q1",
      "P1 X7. Y8.",          "Q1 X0. Y0. Z0."};
  static const std::vector<std::string> siemens = {
      "X7 Y8 Z9",   "X0 Y0",       "Z9",          "A4 C5",          "X=7 Y=8 Z=9",
      "X=AC(7)",    "(X,Y) X7",    "=5 X7 Y8 Z9", "[X]=5 X7 Y8 Z9", "(1) X7 Y8",
      "(\"A\") X7", "X7 Y8 I6 J5", "AP=30 RP=40", "(X) Y8 Z9"};
  static const std::vector<std::string> klartext = {"X+7 Y+8 Z+9", "X+0 Y+0", "Z+9",
                                                    "A+4 C+5",     "IX+7",    "X+7 Y+8 F30"};
  static const std::vector<std::string> cl = {"/7,8,9", "/X,7,Y,8,Z,9", "/7,8,9,0,0,1",
                                              "/ON,7,8,9"};
  switch (frame.dialect) {
    case Dialect::Siemens:
      return siemens;
    case Dialect::Heidenhain:
      return klartext;
    case Dialect::Cl:
      return cl;
    default:
      return iso;
  }
}

ReadOptions axis_options(const Frame& frame) {
  ReadOptions options;
  options.control = machines::options_for(frame.turning ? test::lathe() : machines::gantry());
  options.control.tool_radius = {{1, 3.0}, {2, 0.5}};
  options.dialect = frame.dialect;
  options.turning.control_kind = frame.turning ? ControlKind::Turning : ControlKind::Milling;
  options.limits.blocks = 10000;
  return options;
}

/// Blocks of a program; none where it is refused.
std::optional<program::Path> path_of(const std::string& text, const Frame& frame) {
  try {
    return read_program(text, "part.nc", axis_options(frame)).path;
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

bool same_moves(const program::Path& a, const program::Path& b) {
  return a.motion_blocks == b.motion_blocks &&
         std::ranges::equal(a.blocks, b.blocks, [](const auto& one, const auto& other) {
           return one.end == other.end && one.interpolation == other.interpolation;
         });
}

/// Moves at feed that stand on a line.
int feeds_of(const program::Path& path, int line) {
  return int(std::ranges::count_if(path.blocks, [&](const program::Block& block) {
    return block.line == line && block.interpolation != program::Interpolation::Rapid &&
           block.interpolation != program::Interpolation::Dwell;
  }));
}

bool is_m_word(std::string_view word) {
  return word.size() > 1 && word[0] == 'M' && std::isdigit((unsigned char)(word[1])) != 0;
}

/// A word of a table as a line of the program can begin with it; empty for signs and operators, and
/// for what stands in other places only. Parts of one word are held together by no-break spaces.
std::string written(std::string_view word) {
  std::string text(word);
  for (std::size_t at; (at = text.find("\u00a0")) != std::string::npos;) text.replace(at, 2, " ");
  if (std::isalpha((unsigned char)(text[0])) == 0) return {};
  if (text.find_first_of("[]()#$\"=,") != std::string::npos) return {};
  return text.size() == 1 ? text + "5" : text;  // an address and its number
}

struct Count {
  int words = 0, lines = 0, refused = 0, still = 0, of_motion = 0;
  int listed = 0, within = 0, with_motion = 0;  ///< words; in expressions alone; read with a motion
};

/// The words of axes alone: of `P1 X7. Y8. Q2` X7. Y8., as the others are the tried word's own.
std::string axis_words_of(const std::string& behind) {
  const bool glued = std::string_view("([=").find(behind[0]) != std::string_view::npos;
  std::istringstream words(glued ? behind.substr(std::min(behind.find(' '), behind.size()))
                                 : behind);
  std::string axes;
  for (std::string word; words >> word;)
    if (std::string_view("XYZACUW").find(word[0]) != std::string_view::npos) axes += word + " ";
  return axes;
}

/// One line of a word without effect: refused, or without a move, or with the move that the line
/// makes without the word; and no later move is another.
void try_without_effect(const Frame& frame, const WordTableEntry& use, const std::string& word,
                        const std::string& behind, Count& count) {
  const bool glued = behind[0] == '/' || behind[0] == '(' || behind[0] == '=' || behind[0] == '[';
  const std::string line = word + (glued ? "" : " ") + behind + "\n";
  SCOPED_TRACE(line);
  ++count.lines;
  const auto path = path_of(frame.before + line + frame.after, frame);
  if (!path) {
    ++count.refused;
    return;
  }
  const auto still = path_of(frame.before + "\n" + frame.after, frame);
  ASSERT_TRUE(still);
  if (same_moves(*path, *still)) {
    ++count.still;
    return;
  }
  EXPECT_TRUE(use.beside_motion) << "moves, or changes a move after it";
  const std::string own = axis_words_of(behind);
  const auto plain = path_of(frame.before + own + "\n" + frame.after, frame);
  const auto all = path_of(frame.before + behind + "\n" + frame.after, frame);
  EXPECT_TRUE((plain && same_moves(*path, *plain)) || (all && same_moves(*path, *all)))
      << "the move is not that of the same line without it";
  ++count.of_motion;
}

/// M functions of Klartext stand behind the words of L, and words behind them are their own.
void try_klartext_function(const Frame& frame, const std::string& word, const std::string& behind,
                           Count& count) {
  const std::string line = "L X+11 Y+12 " + word + " " + behind + "\n";
  SCOPED_TRACE(line);
  ++count.lines;
  const auto path = path_of(frame.before + line + frame.after, frame);
  if (!path) {
    ++count.refused;
    return;
  }
  const auto plain = path_of(frame.before + "L X+11 Y+12\n" + frame.after, frame);
  ASSERT_TRUE(plain);
  EXPECT_TRUE(same_moves(*path, *plain)) << "words after the function moved the axes";
  EXPECT_EQ(path->blocks.back().end_s, plain->blocks.back().end_s) << "or changed the feed";
  ++count.still;
}

/// A word that is read and is no motion: the words of its line make no move at feed.
void try_read(const Frame& frame, const std::string& word, const std::string& behind,
              Count& count) {
  const std::string line = word + " " + behind + "\n";
  SCOPED_TRACE(line);
  ++count.lines;
  const auto path = path_of(frame.before + line + frame.after, frame);
  if (!path) {
    ++count.refused;
    return;
  }
  const int number = 1 + int(std::ranges::count(frame.before, '\n'));
  EXPECT_EQ(feeds_of(*path, number), 0) << "a fall through to G1";
  ++count.still;
}

/// A word that the table refuses, alone and with words behind it.
void try_refused(const Frame& frame, const std::string& word, Count& count) {
  // A5 is a position of A, A5=1 the word
  const bool assigned = word.size() == 2 && std::string_view("ABC").find(word[0]) < 3;
  for (const std::string& behind : {std::string(), words_behind(frame).front()}) {
    const std::string line = word + (assigned ? "=1 " : " ") + behind + "\n";
    SCOPED_TRACE(line);
    ++count.lines;
    ++count.refused;
    EXPECT_FALSE(path_of(frame.before + line + frame.after, frame)) << "refused by its table";
  }
}

void try_word(const Frame& frame, const WordTableEntry& use, const std::string& word,
              Count& count) {
  const bool without_effect = use.use == WordTreatment::WithoutEffect;
  ++count.words;
  if (use.use == WordTreatment::Refused) return try_refused(frame, word, count);
  for (const std::string& behind : words_behind(frame)) {
    if (!without_effect)
      try_read(frame, word, behind, count);
    else
      try_without_effect(frame, use, word, behind, count);
    if (frame.dialect == Dialect::Heidenhain && is_m_word(word))
      try_klartext_function(frame, word, behind, count);
  }
}

/// Tries every word of a table: each is tried, or stands within other words only, or is read with
/// the motion of its block.
Count try_table(const Frame& frame, std::span<const WordTableEntry> table) {
  Count count;
  for (const WordTableEntry& use : table)
    each_word(use.word, [&](std::string_view one) {
      ++count.listed;
      // a statement of cutter locations owns what stands behind it: no motion is in force
      const bool has_modes = frame.dialect != Dialect::Cl;
      const std::string word = written(one);
      if (word.empty())
        ++count.within;
      else if (use.use == WordTreatment::Read &&
               (use.beside_motion || one.size() == 1 || !has_modes))
        ++count.with_motion;
      else
        try_word(frame, use, word, count);
    });
  return count;
}

TEST(AxisWords, BesideWordsThatAreNoMotionMoveNothing) {
  int tables = 0;
  for (const Frame& frame : frames) {
    const auto front = std::ranges::find(front_ends(), frame.dialect, &FrontEnd::dialect);
    ASSERT_NE(front, front_ends().end());
    const bool own_table = frame.turning && front->turning_words != nullptr;
    const std::string title = std::string(own_table ? front->turning_title : front->title) +
                              (frame.turning && !own_table ? ", turning" : "");
    tables += own_table || !frame.turning;
    ASSERT_TRUE(path_of(frame.before + "\n" + frame.after, frame)) << title;
    const Count count = try_table(frame, own_table ? front->turning_words() : front->words());
    std::cout << title << ": " << count.listed << " words, " << count.words << " tried, "
              << count.with_motion << " read with a motion, " << count.within << " within others; "
              << count.lines << " lines: " << count.refused << " refused, " << count.still
              << " without a move, " << count.of_motion << " with that of the motion in force\n";
    EXPECT_GT(count.words, 5) << title;
    EXPECT_GT(count.still, 5) << title;
    EXPECT_EQ(count.words + count.with_motion + count.within, count.listed) << title;
  }
  int known = 0;
  for (const FrontEnd& one : front_ends()) known += 1 + (one.turning_words != nullptr);
  EXPECT_EQ(tables, known) << "every table is walked";
}

}  // namespace
}  // namespace abbe::sim::dialects::axis_words_tests

namespace abbe::sim::dialects {
namespace {

std::string words_text(std::string_view text, Dialect dialect) {
  std::string all;
  for (const UsedWord& word : used_words(text, dialect))
    all += fmt::format("{} {} {} line {}; ", word.word, name_of(word.use), word.count, word.line);
  return all;
}

TEST(UsedWords, AreCountedAsTheTableNamesThemWithoutComments) {
  EXPECT_EQ(
      words_text("G01 X1.5 (G38.2 X1) F100 ; M66\ng1x2\nG43.4H1 M8\nG64 P0.1\n", Dialect::LinuxCnc),
      "G1 read 2 line 1; X read 2 line 1; F read 1 line 1; G43.4 read 1 line 3; "
      "M8 without effect 1 line 3; G64 without effect 1 line 4; ");
  EXPECT_EQ(words_text("PARTNO GOTO/1\n  goto /1,2,3\nGOTO/1,2,3 $$ RAPID\nTRACUT/1\n$$ RAPID\n",
                       Dialect::Cl),
            "PARTNO without effect 1 line 1; GOTO read 2 line 2; TRACUT refused 1 line 4; ");
  EXPECT_EQ(words_text("x,y,z\n1,2,3\n", Dialect::Cl), "");
  EXPECT_EQ(words_text("", Dialect::LinuxCnc), "");
}

}  // namespace
}  // namespace abbe::sim::dialects

/// The tables of words in the document are those of the front ends. ABBE_WRITE_WORDS=1 writes them.
namespace abbe::sim::dialects {
namespace {

const std::string file = std::string(ABBE_SOURCE_DIR) + "/sim/dialects/README.md";
const std::string begin_mark = "<!-- words -->\n", end_mark = "<!-- end of words -->";

std::string made_again(const std::string& document) {
  const std::size_t begin = document.find(begin_mark), end = document.find(end_mark);
  if (begin == std::string::npos || end == std::string::npos) return "no marks";
  std::string tables;
  const auto add = [&](std::string_view title, std::span<const WordTableEntry> words) {
    tables += "### " + std::string(title) + "\n\n" + markdown_table(words) + "\n";
  };
  for (const FrontEnd& one : front_ends()) {
    add(one.title, one.words());
    if (one.turning_words != nullptr) add(one.turning_title, one.turning_words());
  }
  return document.substr(0, begin + begin_mark.size()) + tables + document.substr(end);
}

TEST(WordTables, OfTheDocumentAreThoseOfTheFrontEnds) {
  std::ifstream in(file, std::ios::binary);
  const std::string document{std::istreambuf_iterator<char>(in), {}};
  const std::string again = made_again(document);
  if (std::getenv("ABBE_WRITE_WORDS") != nullptr)
    std::ofstream(file, std::ios::binary) << again;
  else
    EXPECT_EQ(document, again) << "ABBE_WRITE_WORDS=1 writes it";
}

void expect_every_word_once(std::string_view title, std::span<const WordTableEntry> table) {
  std::set<std::string> seen;
  for (const WordTableEntry& line : table) {
    EXPECT_GT(line.sentence.size(), 3u) << line.word;
    std::istringstream words{std::string(line.word)};
    for (std::string word; words >> word;)
      EXPECT_TRUE(seen.insert(word).second) << title << " has " << word << " twice";
  }
}

TEST(WordTables, SayEveryWordOnceWithASentence) {
  for (const FrontEnd& one : front_ends()) {
    expect_every_word_once(one.title, one.words());
    if (one.turning_words != nullptr)
      expect_every_word_once(one.turning_title, one.turning_words());
  }
}

}  // namespace
}  // namespace abbe::sim::dialects
