// Which sections does the page have, and in which order?

showHeader();
showStatus();
showHandling();
showCurves();
showBlackBox();
showParameters();
showPredictions();
showTimeHistory();
showInnovations();
showWhiteness();
showShaping();
showVehicle();
showLikelihood();
showNotes();
showExports();
showRecordings();
showOrigin();

over.drawAll();
document.documentElement.dataset.ready = "";
