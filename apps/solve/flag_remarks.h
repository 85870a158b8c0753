#ifndef PLUMBLINE_APPS_SOLVE_FLAG_REMARKS_H_
#define PLUMBLINE_APPS_SOLVE_FLAG_REMARKS_H_

#include <plumbline/frontend/log_reader.h>

#include <string>
#include <vector>

namespace plumbline {

/// Says which flags that were given do nothing for this kind of input:
/// `of_the_other` are those of the other kind.
void RemarkOnFlags(const std::string& name, const char* kind,
                   const char* other_kind,
                   const std::vector<std::string>& of_the_other);

/// Says which flags that were given are for bags where none of these readers of
/// logs reads one.
void RemarkOnBagFlags(const std::string& name,
                      const std::vector<const LogReaderType*>& readers);

/// Says which flags that were given say more of structure where none is looked
/// for. That is no mistake in a sweep, or in a file of flags that is used with
/// and without structure.
void RemarkOnStructureFlags();

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_FLAG_REMARKS_H_
