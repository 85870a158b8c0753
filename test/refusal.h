#ifndef PLUMBLINE_TEST_REFUSAL_H_
#define PLUMBLINE_TEST_REFUSAL_H_

#include <plumbline/core/error.h>

#include <string>

namespace plumbline {

// The message of the Error that a call throws; "accepted" when it throws none.
template <typename Function>
std::string Refusal(const Function& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_REFUSAL_H_
