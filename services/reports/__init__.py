"""Publishers of what is in force: actions, worlds and other states, as their readers need them."""
