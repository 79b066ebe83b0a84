/** Keyboard shortcuts of the whole page, except in text fields. */

const SIDES = ['iso', 'top', 'front', 'side'];

export function keyed(event, editor) {
  const writing = event.target.matches('input[type="text"], select, textarea');
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && 'zy'.includes(key)) {
    event.preventDefault();
    if (key === 'y' || event.shiftKey) editor.state.redo();
    else editor.state.undo();
  } else if (!writing && !event.ctrlKey && !event.metaKey && !event.altKey) {
    if ('1234'.includes(key)) editor.views.look(SIDES[key - 1]);
    else if (key === 'f') editor.viewer?.eye.fit();
    else if (key === 'p') editor.views.parallel();
    else if (key === 'escape') editor.loads?.begin('');
    else if (event.target.id === 'canvas' && editor.viewer?.eye.keyed(key)) event.preventDefault();
  }
}
