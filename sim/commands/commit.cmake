# cmake -DSOURCE=... -DOUT=... -P commit.cmake: writes the commit of the sources, if it is another than OUT has.
# `git archive` fills it in here, so that an archive knows it without git.
set(commit "$Format:%h of %cs$")
if(commit MATCHES "Format")
  set(commit "unknown, built without git")
  find_program(git git)
  if(git)
    execute_process(COMMAND ${git} -C ${SOURCE} rev-parse --show-toplevel
                    OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    # not the repository of another project in which the sources were unpacked
    file(REAL_PATH ${SOURCE} source)
    if(top STREQUAL source)
      execute_process(COMMAND ${git} -C ${SOURCE} log -1 "--format=%h of %cs"
                      OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
      execute_process(COMMAND ${git} -C ${SOURCE} status --porcelain --untracked-files=no
                      OUTPUT_VARIABLE changes OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
      if(changes)
        string(APPEND commit ", with changes since")
      endif()
    endif()
  endif()
endif()
set(text "extern const char* const abbe_commit;\nconst char* const abbe_commit = \"${commit}\";\n")
if(EXISTS ${OUT})
  file(READ ${OUT} before)
endif()
if(NOT text STREQUAL before)
  file(WRITE ${OUT} "${text}")
endif()
