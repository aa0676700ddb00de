x,y,z,i,j,k,feed,colour
1,2,3,0,0,1,100,red
