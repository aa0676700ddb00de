#include "sim/scene/case_name.h"

#include <array>
#include <set>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "sim/scene/nearest_word.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

using Belief = CaseDescription::Belief;
using Channel = CaseDescription::Channel;
using compensation::Strategy;

template <typename T, std::size_t n>
using Words = std::array<std::pair<const char*, T>, n>;

constexpr Words<Belief, 7> beliefs{{{"perfect", Belief::Perfect},
                                    {"identified", Belief::Identified},
                                    {"thermal", Belief::Thermal},
                                    {"composite", Belief::Composite},
                                    {"force", Belief::Force},
                                    {"part", Belief::Part},
                                    {"fused", Belief::Fused}}};
constexpr Words<Strategy, 3> strategies{{{"position", Strategy::Position},
                                         {"decoupled", Strategy::Decoupled},
                                         {"iterated", Strategy::Iterated}}};
constexpr Words<Channel, 7> channels{{{"ideal", Channel::Ideal},
                                      {"program", Channel::Program},
                                      {"pulses", Channel::Pulses},
                                      {"open", Channel::Open},
                                      {"origin", Channel::Origin},
                                      {"table", Channel::Table},
                                      {"piezo", Channel::Piezo}}};

/// The choice that a token names.
/// @throws std::invalid_argument with what it could be
template <typename T, std::size_t n>
T chosen(const Words<T, n>& words, const std::string& token, const char* what) {
  std::string list;
  std::set<std::string> known;
  for (const auto& [word, value] : words) {
    if (token == word) return value;
    list += (list.empty() ? "" : ", ") + std::string(word);
    known.insert(word);
  }
  const auto meant = nearest(token, known);
  throw std::invalid_argument(fmt::format("expected a {} ({}), seen \"{}\"{}", what, list, token,
                                          meant ? " (nearest: \"" + *meant + "\")" : ""));
}

std::vector<std::string> tokens_of(const std::string& name) {
  std::vector<std::string> tokens(1);
  for (const char c : name) {
    if (c == '-')
      tokens.emplace_back();
    else
      tokens.back() += c;
  }
  return tokens;
}

}  // namespace

CaseDescription parse_case(const std::string& name) {
  if (name.find_first_of("./") != std::string::npos) return plug_in_case(name);
  CaseDescription description;
  description.name = name;
  const std::vector<std::string> tokens = tokens_of(name);
  if (tokens.size() != 3)
    throw std::invalid_argument(
        fmt::format("expected belief-strategy-channel such as perfect-iterated-ideal, or a "
                    "plug-in's file such as ./mine.py, seen \"{}\"",
                    name));
  description.belief = chosen(beliefs, tokens[0], "belief");
  description.strategy = chosen(strategies, tokens[1], "strategy");
  description.channel = chosen(channels, tokens[2], "channel");
  return description;
}

CaseDescription plug_in_case(const std::filesystem::path& file) {
  CaseDescription description;
  description.name = file.filename().string();
  // with a slash it is a file wherever it is read again
  description.plug_in = std::filesystem::absolute(file).lexically_normal();
  if (description.name == "error_free" || description.name == "uncompensated")
    throw std::invalid_argument("expected another name for a plug-in than that of a case, seen \"" +
                                description.name + "\"");
  if (!names_a_folder(description.name))
    throw std::invalid_argument(fmt::format(
        "expected a plug-in whose file name is letters, digits, blanks, _ - ., seen \"{}\"",
        file.string()));
  return description;
}

CaseDescription parse_plug_in_way(const std::string& words) {
  const std::vector<std::string> tokens = tokens_of(words);
  if (tokens.size() != 2)
    throw std::invalid_argument(
        fmt::format("expected strategy-channel such as iterated-ideal, seen \"{}\"", words));
  CaseDescription way;
  way.strategy = chosen(strategies, tokens[0], "strategy");
  way.channel = chosen(channels, tokens[1], "channel");
  if (way.channel == Channel::Table)
    throw std::invalid_argument(
        "expected another channel than table, which asks for one place "
        "at a time; a plug-in can be a table itself");
  return way;
}

std::string plug_in_way(const CaseDescription& plug_in) {
  return fmt::format("{}-{}", strategies.at(std::size_t(plug_in.strategy)).first,
                     channels.at(std::size_t(plug_in.channel)).first);
}

}  // namespace abbe::sim
