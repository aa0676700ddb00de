#pragma once

#include "tests/test.h"

/// Random programs of LinuxCNC.
namespace abbe::sim::dialects::test {

/// Programs over the grammar that both read: parameters, expressions, loops, calls, offsets, arcs,
/// cycles, in an order that makes sense to a control.
class Generator {
 public:
  explicit Generator(unsigned seed) : random_(seed) {}

  std::string program() {
    text_ = "G21 G90 G94 G17 G40 G49 G80 F500\n";
    say("o100 sub");
    say("G1 X[#1 + {}] Y#2", number(5));
    say("o101 if [#1 GT {}]", number(20));
    say("G1 Z[#2 / {}]", 1 + whole(9));
    say("o101 elseif [#1 LT 0 AND #2 NE 3]");
    say("G0 Z{}", number(5));
    say("o101 else");
    say("#<z> = [ABS[#1] MOD 7]");
    say("G1 Z#<z> F{}", 100 + whole(900));
    say("o101 endif");
    say("o100 endsub [#1 * 2]");
    say("#31 = {}", number(10));
    say("#<_wide> = [{} - SIN[{}] * {}]", number(9), number(180), number(9));
    const int lines = 10 + whole(30);
    for (int n = 0; n < lines; ++n) line();
    say("G40");
    say("M2");
    return text_;
  }

 private:
  template <typename... Parts>
  void say(const char* format, const Parts&... parts) {
    text_ += fmt::format(fmt::runtime(format), parts...) + "\n";
  }
  int whole(int below) { return int(random_() % unsigned(below)); }
  std::string number(double size) {
    const double value = (double(random_() % 2000001) / 1e6 - 1) * size;
    return fmt::format("{:.{}f}", value, 1 + whole(4));
  }
  std::string value(double size) {
    switch (whole(6)) {
      case 0:
        return fmt::format("[{} + #31]", number(size));
      case 1:
        return fmt::format("[{} * COS[{}] ** 2]", number(size), number(90));
      case 2:
        return "#<_wide>";
      case 3:
        return fmt::format("[ATAN[{}]/[{}] / 10]", number(5), number(5));
      default:
        return number(size);
    }
  }
  void arc() {
    // an arc by its centre: the end lies on the circle
    const double i = 1 + whole(20), turn = 0.3 + 0.1 * whole(50);
    const double x = i * (1 - std::cos(turn)), y = -i * std::sin(turn);
    static constexpr const char* planes[][4] = {
        {"G17", "X", "Y", "I"}, {"G18", "Z", "X", "K"}, {"G19", "Y", "Z", "J"}};
    const auto& plane = planes[whole(3)];
    say("{} G91 G{} {}{:.10f} {}{:.10f} {}{:.10f} P{}", plane[0], 2 + whole(2), plane[1], x,
        plane[2], y, plane[3], i, 1 + whole(3));
    say("G90 G17");
  }
  void cycle() {
    const double r = whole(10), z = r - 1 - whole(20);
    static constexpr const char* codes[] = {"G81", "G82", "G83", "G73", "G85", "G89"};
    const int one = whole(6);
    say("G0 Z{}", 10 + whole(20));
    std::string words;
    if (one == 2 || one == 3) words += fmt::format(" Q{}", 1 + whole(5));
    if (one == 1 || one == 5) words += " P0.1";
    say("G{} {} X{} Y{} Z{} R{}{}", 98 + whole(2), codes[one], value(30), value(30), z, r, words);
    for (int n = whole(3); n > 0; --n) say("X{} Y{}", value(30), value(30));
    if (whole(3) == 0) say("G91 X{} Y{} R-1 Z-2 L{}", value(9), value(9), 1 + whole(4));
    say("G80 G90");
  }
  void offset() {
    switch (whole(8)) {
      case 0:
        // LinuxCNC loses its place where a system is turned while G92 or G52 is in force
        say("G92.1");
        return say("G10 L2 P{} X{} Y{} Z{} R{}", 1 + whole(9), number(50), number(50), number(50),
                   whole(2) == 0 ? "0" : number(90));
      case 1:
        return say("G10 L20 P{} X{} Z{}", 1 + whole(9), number(50), number(50));
      case 2:
        return say("G92 X{} Y{}", value(20), value(20));
      case 3:
        return say("G92.1");
      case 4:
        return say("G52 X{} Z{}", number(20), number(20));
      case 5:
        return say("G54");
      case 6:
        return say("G5{}", 5 + whole(5));
      default:
        return say("G43 H{}", 1 + whole(20));
    }
  }
  void loop() {
    const int label = 200 + label_++;
    // after a break LinuxCNC 2.9 runs the next do loop once only, whatever its condition
    const int kind = whole(broken_ ? 2 : 3);
    const std::string move =
        fmt::format("G91 G1 X{} Y{} A{}\nG90", number(5), number(5), number(9));
    if (kind == 0) {
      say("o{} repeat [{}]\n{}\no{} endrepeat", label, whole(4), move, label);
    } else if (kind == 1) {
      broken_ = true;
      say("#<n> = 0\no{} while [#<n> LT {}]\n{}\n#<n> = [#<n> + 1]\no{} if [#<n> EQ 3]\no{} "
          "break\no{} "
          "endif\no{} endwhile",
          label, whole(6), move, label + 1, label, label + 1, label);
      ++label_;
    } else {
      say("#<n> = {}\no{} do\n{}\n#<n> = [#<n> - 1]\no{} while [#<n> GT 0]", whole(4), label, move,
          label);
    }
  }
  void line() {
    switch (whole(14)) {
      case 0:
      case 1:
        return arc();
      case 2:
        return cycle();
      case 3:
      case 4:
        return offset();
      case 5:
        return loop();
      case 6:
        say("o100 call [{}] [{}]", value(30), value(30));
        return say("G1 X[#<_value> / 2]");
      case 7:
        return say("G28.1\nG0 X{}\nG28 Z{}", value(30), value(30));
      case 8:
        return say("G53 G0 X{} Z{}", number(50), number(50));
      case 9:
        say("G20 G1 X{} Y{}", value(2), value(2));
        return say("G21");
      case 10:
        return say("G0 @{} ^{}", 1 + whole(30), number(180));
      case 11:
        return say("G93 G1 X{} B{} F{}\nG94 F300", value(30), number(90), 1 + whole(9));
      default:
        return say("G{} X{} Y{} Z{}", whole(2), value(40), value(40), value(20));
    }
  }

  std::mt19937 random_;
  std::string text_;
  int label_ = 0;
  bool broken_ = false;  ///< a break has been written
};

/// Cutter compensation: lines and arcs with corners of any kind.
inline std::string compensated_program(unsigned seed) {
  std::mt19937 random(seed);
  const auto number = [&](double size) { return (double(random() % 2000001) / 1e6 - 1) * size; };
  std::string text = "G21 G90 G94 G17 F500\n";
  for (int n = 0; n < 3; ++n) {
    text += fmt::format("G0 X{:.3f} Y{:.3f} Z{:.3f}\n", number(50), number(50), number(5));
    text += fmt::format("{} D{}\n", random() % 2 == 0 ? "G41" : "G42", 1 + random() % 20);
    double x = number(50), y = number(50);
    text += fmt::format("G1 X{:.6f} Y{:.6f}\n", x, y);
    for (int k = 2 + int(random() % 8); k > 0; --k) {
      const double dx = number(40), dy = number(40);
      x += dx;
      y += dy;
      const std::string end = fmt::format("X{:.6f} Y{:.6f}", x, y);
      switch (random() % 5) {
        case 0:
          text += fmt::format("G{} {} R{:.6f}\n", 2 + random() % 2, end,
                              std::hypot(dx, dy) * (0.55 + 0.001 * double(random() % 1000)));
          break;
        case 1:
          text += fmt::format("G{} {} I{:.9f} J{:.9f}\n", 2 + random() % 2, end, dx / 2, dy / 2);
          break;
        case 2:
          text += fmt::format("G1 {} Z{:.3f}\n", end, number(5));
          break;
        default:
          text += fmt::format("G{} {}\n", random() % 2, end);
      }
      if (random() % 6 == 0) text += fmt::format("G1 Z{:.3f}\n", number(5));
    }
    text += "G40\n";
  }
  return text + "G0 X0 Y0\nM2\n";
}

}  // namespace abbe::sim::dialects::test
