/* Empty on purpose: cffi knows these types. Used only when the declarations for it are preprocessed. */
