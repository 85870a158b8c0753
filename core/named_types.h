#ifndef PLUMBLINE_CORE_NAMED_TYPES_H_
#define PLUMBLINE_CORE_NAMED_TYPES_H_

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Plug-ins of one kind as lists show them, whatever the kind.
class PluginList {
 public:
  /// One line of a list.
  struct Entry {
    std::string name;
    std::string description;
  };

  virtual ~PluginList() = default;

  /// Heading: "Log readers (--log_reader)".
  virtual std::string title() const = 0;
  /// In the order of names.
  virtual std::vector<Entry> entries() const = 0;
};

namespace internal {

/// Throws Error unless `name` is a word without white space that is not taken
/// (`is_taken`). `kind` is what messages call it: "detector".
void CheckNewName(const std::string& kind, const std::string& name,
                  bool is_taken);

/// Throws the Error of a look-up that found nothing; it lists `names`, the one
/// nearest to `name` first.
[[noreturn]] void ThrowUnknownName(const std::string& kind,
                                   const std::string& name,
                                   const std::vector<std::string>& names);

}  // namespace internal

/// Plug-ins of one kind by name. `Type` is a struct that has the strings `name`
/// and `description`, and the constants kKind ("log reader", for messages) and
/// kTitle ("Log readers", the heading of lists).
template <typename Type>
class NamedTypes final : public PluginList {
 public:
  /// Adds one. The reference is stable. Throws Error when the name is empty,
  /// has white space or is taken.
  const Type& Add(Type type) {
    internal::CheckNewName(Type::kKind, type.name, Find(type.name) != nullptr);
    auto owned = std::make_unique<Type>(std::move(type));
    const Type& reference = *owned;
    types_.emplace(reference.name, std::move(owned));
    return reference;
  }

  /// Null when no type has this name.
  const Type* Find(const std::string& name) const {
    const auto it = types_.find(name);
    return it == types_.end() ? nullptr : it->second.get();
  }

  /// The first, in the order of names, for which `is_it` holds; null when there
  /// is none.
  template <typename Predicate>
  const Type* FindIf(const Predicate& is_it) const {
    for (const auto& entry : types_) {
      if (is_it(*entry.second)) return entry.second.get();
    }
    return nullptr;
  }

  /// Throws Error that lists the known names when no type has this name.
  const Type& Get(const std::string& name) const {
    const Type* type = Find(name);
    if (type != nullptr) return *type;
    std::vector<std::string> names;
    for (const auto& entry : types_) names.push_back(entry.first);
    internal::ThrowUnknownName(Type::kKind, name, names);
  }

  /// All, in the order of names.
  std::vector<const Type*> All() const {
    std::vector<const Type*> all;
    all.reserve(types_.size());
    for (const auto& entry : types_) all.push_back(entry.second.get());
    return all;
  }

  std::string title() const override { return Type::kTitle; }

  std::vector<Entry> entries() const override {
    std::vector<Entry> entries;
    for (const Type* type : All()) {
      entries.push_back({type->name, type->description});
    }
    return entries;
  }

 private:
  std::map<std::string, std::unique_ptr<Type>> types_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_NAMED_TYPES_H_
