// Which sections does the page have, and in which order?

showHeader();
showStatus();
showParameters();
showExports();
showPredictions();
showTimeHistory();
showInnovations();
showWhiteness();
showShaping();
showVehicle();
showLikelihood();
showNotes();
showRecordings();
showOrigin();

over.drawAll();
document.documentElement.dataset.ready = "";
