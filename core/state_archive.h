#ifndef PLUMBLINE_CORE_STATE_ARCHIVE_H_
#define PLUMBLINE_CORE_STATE_ARCHIVE_H_

#include <plumbline/core/error.h>

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace plumbline {

/// Values as bytes, and back, bit by bit, for the same program on the same
/// machine. One function `Exchange(archive, value)` serves both ways: a
/// StateWriter appends the value, a StateReader sets it. Types made of others
/// have an overload that names their members by structured binding, so that a
/// member that is added later does not compile until it is in there.
class StateWriter {
 public:
  static constexpr bool kReads = false;

  /// Appends the `size` bytes at `data`.
  void Bytes(void* data, std::size_t size) {
    bytes_.append(static_cast<const char*>(data), size);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// The other way. Throws Error when the bytes end too early.
class StateReader {
 public:
  static constexpr bool kReads = true;

  /// `bytes` must outlive it.
  explicit StateReader(std::string_view bytes) : bytes_(bytes) {}

  /// Takes the next `size` bytes to `data`.
  void Bytes(void* data, std::size_t size) {
    if (size > bytes_.size()) {
      throw PLUMBLINE_ERROR("the state ends too early", "a whole one");
    }
    if (size > 0) std::memcpy(data, bytes_.data(), size);
    bytes_.remove_prefix(size);
  }
  /// Those that were not read.
  std::size_t size() const { return bytes_.size(); }

 private:
  std::string_view bytes_;
};

/// Numbers and enumerations.
template <typename Archive, typename T>
std::enable_if_t<std::is_arithmetic_v<T> || std::is_enum_v<T>> Exchange(
    Archive& archive, T& value) {
  archive.Bytes(&value, sizeof value);
}

/// How many there are. Read, no more than there are bytes left: each element
/// takes one at least.
template <typename Archive>
std::size_t ExchangeSize(Archive& archive, std::size_t size) {
  auto number = static_cast<std::uint64_t>(size);
  Exchange(archive, number);
  if constexpr (Archive::kReads) {
    if (number > archive.size()) {
      throw PLUMBLINE_ERROR("the state ends too early", "a whole one");
    }
  }
  return static_cast<std::size_t>(number);
}

template <typename Archive>
void Exchange(Archive& archive, std::string& value) {
  const std::size_t size = ExchangeSize(archive, value.size());
  value.resize(size);
  archive.Bytes(value.data(), size);
}

template <typename Archive, typename Scalar, int kRows, int kColumns>
void Exchange(Archive& archive, Eigen::Matrix<Scalar, kRows, kColumns>& value) {
  std::int64_t rows = value.rows();
  std::int64_t columns = value.cols();
  if constexpr (kRows == Eigen::Dynamic) Exchange(archive, rows);
  if constexpr (kColumns == Eigen::Dynamic) Exchange(archive, columns);
  if constexpr (Archive::kReads) value.resize(rows, columns);
  archive.Bytes(value.data(),
                static_cast<std::size_t>(value.size()) * sizeof(Scalar));
}

template <typename Archive, typename T, std::size_t kSize>
void Exchange(Archive& archive, std::array<T, kSize>& values) {
  for (T& value : values) Exchange(archive, value);
}

template <typename Archive, typename A, typename B>
void Exchange(Archive& archive, std::pair<A, B>& values);
template <typename Archive, typename T>
void Exchange(Archive& archive, std::vector<T>& values);
template <typename Archive, typename T>
void Exchange(Archive& archive, std::deque<T>& values);
template <typename Archive, typename Key, typename T>
void Exchange(Archive& archive, std::map<Key, T>& values);

/// All of them in turn.
template <typename Archive, typename... Values>
void ExchangeAll(Archive& archive, Values&... values) {
  (Exchange(archive, values), ...);
}

template <typename Archive, typename A, typename B>
void Exchange(Archive& archive, std::pair<A, B>& values) {
  ExchangeAll(archive, values.first, values.second);
}

template <typename Archive, typename T>
void Exchange(Archive& archive, std::vector<T>& values) {
  values.resize(ExchangeSize(archive, values.size()));
  for (T& value : values) Exchange(archive, value);
}

template <typename Archive, typename T>
void Exchange(Archive& archive, std::deque<T>& values) {
  values.resize(ExchangeSize(archive, values.size()));
  for (T& value : values) Exchange(archive, value);
}

template <typename Archive, typename Key, typename T>
void Exchange(Archive& archive, std::map<Key, T>& values) {
  const std::size_t size = ExchangeSize(archive, values.size());
  if constexpr (Archive::kReads) {
    values.clear();
    for (std::size_t i = 0; i < size; ++i) {
      Key key{};
      Exchange(archive, key);
      Exchange(archive, values[key]);
    }
  } else {
    for (auto& [key, value] : values) {
      Key copy = key;
      Exchange(archive, copy);
      Exchange(archive, value);
    }
  }
}

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_STATE_ARCHIVE_H_
