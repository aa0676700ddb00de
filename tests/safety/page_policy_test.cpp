#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include <gtest/gtest.h>

#include "sim/report/page_template.h"
#include "tests/safety/every_command.h"

namespace abbe::safety {
namespace {

std::string in_hex(std::string_view bytes) {
  std::string text;
  for (const std::uint8_t byte : sim::sha256(bytes)) text += fmt::format("{:02x}", byte);
  return text;
}

// FIPS 180-4 and its examples; lengths around the end of a block against Python's hashlib
TEST(ScriptHash, IsSha256) {
  EXPECT_EQ(in_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(in_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(in_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(in_hex(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  for (const std::size_t length : {55u, 56u, 63u, 64u, 65u, 119u, 120u}) {
    const Ran python = shell("python3 -c \"import hashlib; print(hashlib.sha256(b'x' * " +
                             std::to_string(length) + ").hexdigest())\"");
    if (python.code != 0) GTEST_SKIP() << "python3 is not installed";
    EXPECT_EQ(in_hex(std::string(length, 'x')) + "\n", python.text) << length;
  }
}

/// Says for the scripts of a page whether its policy names the hash of each, and nothing else.
constexpr const char* judge = R"py(
import base64, hashlib, re, sys
page = open(sys.argv[1], 'rb').read()
policy = re.search(rb'Content-Security-Policy" content="([^"]*)"', page).group(1).decode()
allowed = re.search(r'script-src ([^;]*);', policy).group(1).split()
scripts = re.findall(rb'<script>(.*?)</script>', page, re.S)
hashes = ["'sha256-" + base64.b64encode(hashlib.sha256(s).digest()).decode() + "'" for s in scripts]
print('same' if scripts and allowed == hashes else f'allowed {allowed}, seen {hashes}')
)py";

TEST(PagePolicy, NamesTheHashOfTheScriptThatIsInThePage) {
  const Folder folder;
  write_inputs(folder);
  folder.write("judge.py", judge);
  const std::string here = "cd " + folder.path().string() + " &&";
  for (const std::string line :
       {"report scene.toml -o page.html", "evaluate readings/ball_bar.csv --report -o evaluated",
        "study study.toml --report -o studied"}) {
    const Ran ran = run(line, here);
    ASSERT_EQ(ran.code, 0) << line << ": " << ran.text;
    const std::string page =
        line.ends_with(".html") ? "page.html" : line.substr(line.rfind(' ') + 1) + "/report.html";
    EXPECT_EQ(bytes(folder / page).find("script-src 'unsafe-inline'"), std::string::npos) << line;
    const Ran judged = shell(here + " python3 judge.py " + page);
    if (judged.text.find("not found") != std::string::npos) GTEST_SKIP() << "no python3";
    EXPECT_EQ(judged.text, "same\n") << line;
  }
}

}  // namespace
}  // namespace abbe::safety
