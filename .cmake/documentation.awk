# What Doxygen reads in place of a header.
#
# Fields and formulas in comments stand under each other:
#
#   ///   residual:   r = L (f - expected)
#   ///   unit:       m
#
# Four more blanks make them a block that is shown as it stands, where Doxygen
# would join the lines to a paragraph. And a comment above several declarations
# that follow each other without a blank line holds for all of them, and that of
# a type for its fields up to the first comment.

function declares(line) {
  return line ~ /[;{}(,=]$/ && line !~ /^ *(#|\/\/|}|public:|private:|protected:)/ &&
         line !~ /^ *(namespace|struct|class|enum|union|friend|extern|template|using)/
}

# What a type says of itself is told once, at DescribedBlock and AddRelation;
# Doxygen's EXCLUDE_SYMBOLS leaves constants out, but not aliases.
/^ *using (Blocks|Manifold) =/ {
  is_left_out = 1
}
is_left_out {
  if (/;$/) is_left_out = 0
  print ""
  next
}

# A comment.
/^ *\/\/\// {
  line = $0
  if (match(line, /^ *\/\/\/   /)) {
    line = substr(line, 1, RLENGTH) "    " substr(line, RLENGTH + 1)
  }
  if (!in_comment) comment = ""
  in_comment = 1
  is_of_type = 0
  comment = comment line "\n"
  print line
  next
}

{
  is_first_line = !goes_on && depth == 0
  if (is_first_line && declares($0) && !in_comment) printf "%s", comment
  if (in_comment && /^ *(struct|class) /) is_of_type = 1
  if (/^ *$/ && !is_of_type) comment = ""
  in_comment = 0
  print
  # Declarations of several lines and bodies of functions.
  if (!/^ *#/ && !/^ *\/\//) {
    code = $0
    sub(/ *\/\/.*/, "", code)
    is_type = code ~ /^ *(namespace|struct|class|enum|union|extern)/
    opens = gsub(/{/, "{", code)
    closes = gsub(/}/, "}", code)
    if (depth > 0 || (!is_type && opens > closes)) depth += opens - closes
    goes_on = depth == 0 && code != "" && code !~ /[;{}:>]$/
  }
}
