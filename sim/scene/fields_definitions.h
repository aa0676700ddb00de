#pragma once

/// What the templates of `Fields` do. Only `fields.h` includes this, at its end.
namespace abbe::sim {

std::set<std::string> words_of(const Key& key);

/// What the functions of a field hold in common: a copy of the field is a copy of a pointer, not of
/// every list below it.
template <typename V>
std::shared_ptr<const V> shared(V value) {
  return std::make_shared<const V>(std::move(value));
}
/// The keys, all the way down, whose `unit` may also be another: the pattern of "value_um" becomes
/// "value_(um|urad)".
std::vector<Key> with_other_unit(std::vector<Key> keys, const std::string& unit,
                                 const std::string& other);

/// Puts a list of tables, one for each value, unless there is none.
template <typename U>
void put_tables(Node::Table& table, const std::string& key, const std::vector<U>& values,
                const Fields<U>& fields) {
  Node::Array all;
  for (const U& one : values) all.push_back(Node{{}, fields.written(one)});
  if (!all.empty()) put(table, key, std::move(all));
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::add_number(const KeyName& name, M member, const Range& range,
                                 const char* sentence, double unit) {
  using V = Value<M>;
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Number, sentence));
  key->range = range;
  if constexpr (!fields_detail::is_optional<V>::value) {
    if (!key->required && key->fallback.empty())
      key->fallback = shown_default(std::invoke(member, usual_) / unit);
  }
  const auto read = [key, member, unit](TableReader& reader, T& to) {
    const auto written = reader.number_as_written(key->name, key->range);
    if (key->required && !reader.has(key->name)) reader.missing(key->name, "a number");
    if (written)
      std::invoke(member, to) = *written * unit;
    else if (key->required)
      std::invoke(member, to) = 1.0;  // harmless, so that reading goes on to the next fault
  };
  const auto write = [key, member, unit](const T& from, Node::Table& to) {
    if constexpr (fields_detail::is_optional<V>::value) {
      if (std::invoke(member, from)) put(to, key->name, in_unit(*std::invoke(member, from), unit));
    } else if (std::isfinite(std::invoke(member, from))) {
      put(to, key->name, in_unit(std::invoke(member, from), unit));
    }
  };
  return add(key, read, write);
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::whole(const KeyName& name, M member, std::int64_t min, std::int64_t max,
                            const char* sentence) {
  using V = Value<M>;
  using Bare = typename fields_detail::bare<V>::type;
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Whole, sentence));
  key->range = {double(min), double(max)};
  if constexpr (!fields_detail::is_optional<V>::value) {
    if (!key->required && key->fallback.empty())
      key->fallback = std::to_string(std::invoke(member, usual_));
  }
  const auto read = [key, member, min, max](TableReader& reader, T& to) {
    if (key->required && !reader.has(key->name)) reader.missing(key->name, "a whole number");
    if (const auto value = reader.maybe_integer(key->name, min, max))
      std::invoke(member, to) = Bare(*value);
  };
  const auto write = [key, member](const T& from, Node::Table& to) {
    if constexpr (fields_detail::is_optional<V>::value) {
      if (std::invoke(member, from)) put(to, key->name, std::int64_t(*std::invoke(member, from)));
    } else {
      put(to, key->name, std::int64_t(std::invoke(member, from)));
    }
  };
  return add(key, read, write);
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::boolean(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Boolean, sentence));
  if (key->fallback.empty()) key->fallback = std::invoke(member, usual_) ? "true" : "false";
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        std::invoke(member, to) = reader.boolean(key->name, std::invoke(member, to));
      },
      [key, member](const T& from, Node::Table& to) {
        put(to, key->name, bool(std::invoke(member, from)));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::text(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Text, sentence));
  if (key->fallback.empty()) key->fallback = std::string(std::invoke(member, usual_));
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        if (key->required && !reader.has(key->name)) reader.missing(key->name, "a text");
        std::invoke(member, to) = reader.text(key->name, std::string(std::invoke(member, to)));
      },
      [key, member](const T& from, Node::Table& to) {
        const std::string text(std::invoke(member, from));
        if (!text.empty()) put(to, key->name, text);
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::texts(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Texts, sentence));
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        if (reader.know(key->name)) std::invoke(member, to) = reader.texts(key->name);
      },
      [key, member](const T& from, Node::Table& to) {
        Node::Array all;
        for (const std::string& one : std::invoke(member, from)) all.push_back(Node{{}, one});
        if (!all.empty()) put(to, key->name, std::move(all));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::word(const KeyName& name, M member, std::vector<WordOf<M>> words,
                           const char* sentence) {
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Text, sentence));
  for (const WordOf<M>& one : words) {
    key->words.push_back({one.word, one.sentence, {}});
    if (!key->required && key->fallback.empty() && one.value == std::invoke(member, usual_))
      key->fallback = one.word;
  }
  return add(
      key,
      [key, member, words](TableReader& reader, T& to) {
        const std::optional<std::string> seen =
            reader.word(key->name, words_of(*key), key->required);
        if (!seen && key->required) std::invoke(member, to) = words.front().value;
        for (const WordOf<M>& one : words)
          if (seen == one.word) std::invoke(member, to) = one.value;
      },
      [key, member, words](const T& from, Node::Table& to) {
        for (const WordOf<M>& one : words)
          if (one.value == std::invoke(member, from))
            return put(to, key->name, std::string(one.word));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::vector(const KeyName& name, M member, const char* sentence) {
  return numbers(name, member, 3, sentence);
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::direction(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(key_of_numbers(name, 3, sentence));
  if (!key->required && key->fallback.empty())
    key->fallback = shown_default(Eigen::VectorXd(std::invoke(member, usual_)));
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        std::invoke(member, to) = key->required
                                      ? reader.direction(key->name)
                                      : reader.direction(key->name, std::invoke(member, to));
      },
      [key, member](const T& from, Node::Table& to) {
        const Eigen::Vector3d direction = std::invoke(member, from);
        put_numbers(to, key->name, direction.normalized(), 1.0);
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::numbers(const KeyName& name, M member, int size, const char* sentence) {
  using V = Value<M>;
  const auto key = std::make_shared<Key>(key_of_numbers(name, size, sentence));
  if constexpr (!fields_detail::is_optional<V>::value) {
    if (!key->required && key->fallback.empty())
      key->fallback =
          shown_default(Eigen::VectorXd(std::invoke(member, usual_)) / unit_of(name.name));
  }
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        if (key->required)
          std::invoke(member, to) = reader.numbers(key->name, key->size);
        else if (const auto values = reader.maybe_numbers(key->name, key->size))
          std::invoke(member, to) = *values;
      },
      [key, member](const T& from, Node::Table& to) {
        if constexpr (fields_detail::is_optional<V>::value) {
          if (std::invoke(member, from))
            put_numbers(to, key->name, *std::invoke(member, from), unit_of(key->name));
        } else {
          put_numbers(to, key->name, std::invoke(member, from), unit_of(key->name));
        }
      });
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::table(const KeyName& name, M member, Fields<U> fields, const char* sentence) {
  using V = Value<M>;
  const auto own = shared(std::move(fields));
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Table, sentence, own->keys()));
  return add(
      key,
      [key, member, own](TableReader& reader, T& to) {
        const Node* node = reader.section(key->name);
        if (!node && key->required && !reader.has(key->name)) reader.missing(key->name, "a table");
        if (!node) return;
        const std::string where = reader.name_of(key->name);
        if constexpr (fields_detail::is_optional<V>::value)
          std::invoke(member, to) = own->read_table(*node, where, reader.faults());
        else
          std::invoke(member, to) =
              own->read_table(*node, where, reader.faults(), std::invoke(member, to));
      },
      [key, member, own](const T& from, Node::Table& to) {
        if constexpr (fields_detail::is_optional<V>::value) {
          if (std::invoke(member, from))
            put(to, key->name, own->written(*std::invoke(member, from)));
        } else if (Node::Table entries = own->written(std::invoke(member, from));
                   !entries.empty()) {
          put(to, key->name, std::move(entries));
        }
      });
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::tables(const KeyName& name, M member, Fields<U> fields,
                             const char* sentence) {
  const auto own = shared(fields);
  const auto read = [key = name.name, required = name.required, member, own](TableReader& reader,
                                                                             T& to) {
    if (required && !reader.has(key)) reader.missing(key, "a list of tables");
    for (const Node* node : reader.tables(key))
      std::invoke(member, to)
          .push_back(own->read_table(*node, reader.name_of(key), reader.faults()));
  };
  return tables(name, member, std::move(fields), sentence, read);
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::tables(const KeyName& name, M member, Fields<U> fields, const char* sentence,
                             std::function<void(TableReader&, T&)> read) {
  const auto own = shared(std::move(fields));
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Tables, sentence, own->keys()));
  return add(key, std::move(read), [key, member, own](const T& from, Node::Table& to) {
    put_tables(to, key->name, std::invoke(member, from), *own);
  });
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::all_of(M member, Fields<U> fields) {
  const auto own = shared(std::move(fields));
  return custom(
      own->keys(),
      [member, own](TableReader& reader, T& to) {
        std::invoke(member, to) = own->read(reader, std::invoke(member, to));
      },
      [member, own](const T& from, Node::Table& to) {
        put_all(to, own->written(std::invoke(member, from)));
      });
}

template <typename T>
Fields<T>& Fields<T>::where(std::function<bool(const T&)> holds, Fields fields) {
  const auto own = shared(std::move(fields));
  std::vector<Key> keys = own->keys();
  for (Key& key : keys) key.required = false;
  return custom(
      std::move(keys),
      [holds, own](TableReader& reader, T& to) {
        if (holds(to)) to = own->read(reader, std::move(to));
      },
      [holds, own](const T& from, Node::Table& to) {
        if (holds(from)) put_all(to, own->written(from));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::kinds(const KeyName& name, M member, std::vector<Alternative<Value<M>>> kinds,
                            const char* sentence) {
  const auto key = std::make_shared<Key>(key_of(name, Key::Kind::Text, sentence));
  for (const auto& one : kinds) key->words.push_back(one.word);
  const auto all = shared(std::move(kinds));
  return add(
      key,
      [key, member, all](TableReader& reader, T& to) {
        const auto given = reader.word(key->name, words_of(*key), key->required);
        // beside a word that is none nobody knows which keys are meant
        if (!given && reader.has(key->name)) return know_all(reader, key->words);
        const std::string word = given.value_or(key->words.front().word);
        for (const auto& one : *all)
          if (one.word.word == word) std::invoke(member, to) = one.read(reader);
      },
      [key, member, all](const T& from, Node::Table& to) {
        for (const auto& one : *all) {
          Node::Table own;
          if (!one.write(std::invoke(member, from), own)) continue;
          put(to, key->name, one.word.word);
          return put_all(to, std::move(own));
        }
      });
}

}  // namespace abbe::sim
