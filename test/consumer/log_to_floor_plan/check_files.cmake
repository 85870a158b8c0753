# The files that log_to_floor_plan left in this folder begin as such files do and
# hold a building.
function(expect file pattern size)
  file(SIZE ${file} bytes)
  file(READ ${file} text LIMIT 4000)
  if(NOT text MATCHES "${pattern}" OR bytes LESS size)
    message(FATAL_ERROR "${file}: ${bytes} bytes, begins '${text}': expected ${pattern}")
  endif()
endfunction()
expect(floorplan.svg "<svg[^>]*width=" 5000)
expect(floorplan.dxf "SECTION" 5000)
expect(occupancy.pgm "^P5" 100000)
expect(occupancy.yaml "resolution: 0.05" 50)
expect(map.json "\"features\"" 10000)
